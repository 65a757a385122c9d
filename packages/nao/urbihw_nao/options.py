"""What the settings may say of a Nao: ``[options]`` in ``urbihw.toml``."""

from __future__ import annotations

from typing import Final

from urbihw.frozen import frozen
from urbihw.settings import SWITCH, TEXT, BadSetting, SettingsTable, is_address, number, setting, whole
from urbihw_nao.qimessaging.hosting import EndPointSettings
from urbihw_nao.qimessaging.login import Login

SHIFTS_S: Final = (0.02, 0.5)
"""Least and greatest ``dcm_shift``."""


@frozen(slots=False)
class NaoOptions(SettingsTable):
    """The options.

    Attributes:
        user: who logs in to NAOqi, "" for a robot without a login.
        password: of that user; it travels in clear over ``qi://``, and is never logged.
        user_key, token_key: under which names user and password are sent.
        token_file: where the token is kept that a robot without a password hands out at the first login; "" to accept
            none.  Once the file is there, its token is the password.
        other_hosts: log in to services on other computers too, if the robot's directory names some: user and password
            go there.
        fraction: of its greatest speed at which a joint goes to its goal, 0.01 to 1.
        dcm_write: joints are written by dated commands of the DCM, instead of setAngles of ALMotion.
        dcm_shift: s from the writing of such a command to its date.
        trace_file: where ALMotor.setTrace writes; "" for a file beside the control socket.
        module_host: address to listen on for callers of modules, "" for the one by which this computer reaches the
            robot.
        module_port: port to listen on for them, 0 for any.
        module_http_port: port for calls of modules by HTTP, 0 for none.
        module_http_host: address to listen on for those.

    ``user`` and ``password`` are also those of callers of modules.
    """

    user: str = setting("", TEXT)
    password: str = setting("", TEXT, secret=True)
    user_key: str = setting("auth_user", TEXT)
    token_key: str = setting("auth_token", TEXT)
    token_file: str = setting("", TEXT, file=True)
    other_hosts: bool = setting(False, SWITCH)
    fraction: float = setting(1.0, number(0.01, 1.0))
    dcm_write: bool = setting(False, SWITCH)
    dcm_shift: float = setting(0.05, number(*SHIFTS_S, " s"))
    trace_file: str = setting("", TEXT, file=True)
    module_host: str = setting("", TEXT)
    module_port: int = setting(0, whole(0, 65535))
    module_http_port: int = setting(0, whole(0, 65535))
    module_http_host: str = setting("127.0.0.1", TEXT)

    def login(self) -> Login:
        """Who logs in, and how."""
        return Login(
            self.user, self.password, self.user_key, self.token_key, self.token_file, self.other_hosts
        )  # fmt: skip

    def end_point(self) -> EndPointSettings:
        """Where modules are called, and by whom.  Raises BadSetting."""
        for name in ("module_host", "module_http_host"):
            host = getattr(self, name)
            if not is_address(host) and (host or name == "module_http_host"):
                raise BadSetting(f"options.{name}: takes an address such as 127.0.0.1, not {host!r}")
        return EndPointSettings(self.login(), self.module_host, self.module_port)
