"""The signatures of what the protocol itself sends (fact sheet, section 4)."""

from __future__ import annotations

from typing import Final

METHOD: Final = (
    "(Issss[(ss)<MetaMethodParameter,name,description>]s)"
    "<MetaMethod,uid,returnSignature,name,parametersSignature,description,parameters,returnDescription>"
)
SIGNAL: Final = "(Iss)<MetaSignal,uid,name,signature>"
PROPERTY: Final = "(Iss)<MetaProperty,uid,name,signature>"
META_OBJECT: Final = f"({{I{METHOD}}}{{I{SIGNAL}}}{{I{PROPERTY}}}s)<MetaObject,methods,signals,properties,description>"
