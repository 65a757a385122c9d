"""Python modules with devices: search along URBI_UOBJECT_PATH, import, and list of their classes.

A module is a Python file, or a folder with ``__init__.py``.  Its device classes are those named in ``__uobjects__``.
Without ``__uobjects__`` they are the classes derived from UObject that the module itself defines and whose names do not
begin with an underscore.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType

from urbihw.kernel.uobject.errors import BadConfig
from urbihw.kernel.uobject.uobject import UObject, UObjectHub

PATH = "URBI_UOBJECT_PATH"


def search_path() -> list[Path]:
    """The folders of the search path; an empty entry of the variable stands for the working directory."""
    return [Path(part or ".") for part in os.environ.get(PATH, "").split(":")]


def find(name: str) -> Path:
    """The file of a module, whose name may have an extension.  Raises BadConfig with the list of searched folders."""
    wanted = Path(name.removesuffix(".py"))
    folders = [Path()] if wanted.is_absolute() else search_path()
    for folder in folders:
        for path in (folder / f"{wanted}.py", folder / wanted / "__init__.py"):
            if path.is_file():
                return path
    where = ", ".join(str(folder) for folder in folders)
    raise BadConfig(f"module {name} not found in {where}: set {PATH}")


def import_module(name: str) -> ModuleType:
    """Import a module, once.  Raises BadConfig with one line for any exception of the module.

    The folder of the module is added to Python's module path, so that the module can import its neighbours.
    """
    path = find(name).resolve()
    key = f"_uobject_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    if key in sys.modules:
        return sys.modules[key]
    spec = importlib.util.spec_from_file_location(key, path)
    if spec is None or spec.loader is None:
        raise BadConfig(f"module {path} cannot be imported: it is no Python file")
    module = importlib.util.module_from_spec(spec)
    folder = str(path.parent)
    if folder not in sys.path:
        sys.path.append(folder)
    sys.modules[key] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[key]
        raise BadConfig(f"module {path} does not import: {_reason(error, path)}") from error
    return module


def _reason(error: BaseException, path: Path) -> str:
    """The error in words, with the line number if it arose in the module itself."""
    line = error.lineno if isinstance(error, SyntaxError) else None
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(path):
            line = trace.tb_lineno
        trace = trace.tb_next
    words = error.msg if isinstance(error, SyntaxError) else str(error)
    place = f"line {line}: " if line is not None else ""
    return f"{place}{type(error).__name__}: {words}".replace("\n", " ")


def classes_of(module: ModuleType) -> list[type[UObject]]:
    """The device classes of a module, hubs first.  Raises BadConfig if there are none."""
    declared = getattr(module, "__uobjects__", None)
    if declared is None:
        declared = [
            value
            for name, value in vars(module).items()
            if isinstance(value, type) and issubclass(value, UObject) and value.__module__ == module.__name__
            and not name.startswith("_")
        ]
    kinds = list(dict.fromkeys(declared))
    strangers = [kind for kind in kinds if not (isinstance(kind, type) and issubclass(kind, UObject))]
    if strangers:
        raise BadConfig(f"module {module.__file__}: {strangers[0]!r} in __uobjects__ is no class derived from UObject")
    if not kinds:
        raise BadConfig(f"module {module.__file__} defines no class derived from UObject")
    return sorted(kinds, key=lambda kind: not issubclass(kind, UObjectHub))
