"""The commands of ARCOS by name: number, kind of argument, and purpose.

Sources: the ARCOS chapter of the Pioneer 3 manual, the P2OS command table, ARIA's ``ArCommands.h``, MobileSim.
"""

from __future__ import annotations

from typing import Final

from urbihw.buses.errors import BadValue
from urbihw.frozen import frozen
from urbihw.platforms.p3dx.protocol import LARGEST, command

NOTHING, NUMBER, WORD, STRING = "nothing", "a number", "a word of 16 bits", "bytes"


@frozen
class ArcosCommand:
    """One command: ``takes`` is the kind of its argument."""

    number: int
    takes: str
    meaning: str


COMMANDS: Final[dict[str, ArcosCommand]] = {
    "PULSE": ArcosCommand(0, NOTHING, "reset the watchdog"),
    "OPEN": ArcosCommand(1, NOTHING, "start the servers"),
    "CLOSE": ArcosCommand(2, NOTHING, "stop and close the connection"),
    "POLLING": ArcosCommand(3, STRING, "order in which the sonars fire, numbered from 1"),
    "ENABLE": ArcosCommand(4, NUMBER, "motors on (1), off (0)"),
    "SETA": ArcosCommand(5, NUMBER, "acceleration (+) or deceleration (-), mm/s2"),
    "SETV": ArcosCommand(6, NUMBER, "fastest translation, mm/s"),
    "SETO": ArcosCommand(7, NOTHING, "odometry to 0, 0, 0"),
    "MOVE": ArcosCommand(8, NUMBER, "translate, mm"),
    "ROTATE": ArcosCommand(9, NUMBER, "rotate, deg/s"),
    "SETRV": ArcosCommand(10, NUMBER, "fastest rotation, deg/s"),
    "VEL": ArcosCommand(11, NUMBER, "translate, mm/s"),
    "HEAD": ArcosCommand(12, NUMBER, "turn to a heading, deg"),
    "DHEAD": ArcosCommand(13, NUMBER, "turn by an angle, deg"),
    "SAY": ArcosCommand(15, STRING, "tones: pairs of duration in 20 ms and tone"),
    "JOYREQUEST": ArcosCommand(17, NUMBER, "joystick packets: 0 none, 1 one, 2 all"),
    "CONFIG": ArcosCommand(18, NOTHING, "ask for the configuration"),
    "ENCODER": ArcosCommand(19, NUMBER, "encoder packets: 0 none, 1 one, 2 all"),
    "SETRVDIR": ArcosCommand(20, NUMBER, "fastest rotation per direction, deg/s"),
    "RVEL": ArcosCommand(21, NUMBER, "rotate, deg/s"),
    "DCHEAD": ArcosCommand(22, NUMBER, "heading relative to the last set point, deg"),
    "SETRA": ArcosCommand(23, NUMBER, "rotational acceleration (+) or deceleration (-), deg/s2"),
    "IMUREQUEST": ArcosCommand(26, NUMBER, "inertial packets (Seekur)"),
    "SONAR": ArcosCommand(28, NUMBER, "sonars on (1), off (0)"),
    "STOP": ArcosCommand(29, NOTHING, "stop; the motors stay on"),
    "DIGOUT": ArcosCommand(30, WORD, "digital outputs: mask in the high byte, values in the low one"),
    "VEL2": ArcosCommand(32, WORD, "wheels: right in the low byte, left in the high one, 20 mm/s each"),
    "GRIPPER": ArcosCommand(33, NUMBER, "gripper action"),
    "ADSEL": ArcosCommand(35, NUMBER, "analog port to report"),
    "GRIPPERVAL": ArcosCommand(36, NUMBER, "gripper value"),
    "GRIPPERPACREQUEST": ArcosCommand(37, NUMBER, "gripper packets: 0 none, 1 one, 2 all"),
    "GYROCALCW": ArcosCommand(38, NUMBER, "gyro calibration, clockwise"),
    "GYROCALCCW": ArcosCommand(39, NUMBER, "gyro calibration, counterclockwise"),
    "IOREQUEST": ArcosCommand(40, NUMBER, "packets of inputs and outputs: 0 none, 1 one, 2 all"),
    "PTUPOS": ArcosCommand(41, WORD, "servo: port in the high byte, pulse width in the low one"),
    "TTY2": ArcosCommand(42, STRING, "bytes to the port AUX1"),
    "TTY3": ArcosCommand(66, STRING, "bytes to the port AUX2"),
    "TTY4": ArcosCommand(60, STRING, "bytes to the port AUX3"),
    "GETAUX": ArcosCommand(43, NUMBER, "ask for bytes from AUX1; 0 forgets those that wait"),
    "GETAUX2": ArcosCommand(67, NUMBER, "ask for bytes from AUX2; 0 forgets those that wait"),
    "GETAUX3": ArcosCommand(61, NUMBER, "ask for bytes from AUX3; 0 forgets those that wait"),
    "BUMPSTALL": ArcosCommand(44, NUMBER, "stall on a bump: 0 never, 1 front, 2 rear, 3 both"),
    "TCM2": ArcosCommand(45, NUMBER, "compass module"),
    "JOYDRIVE": ArcosCommand(47, NUMBER, "joystick may drive"),
    "SONARCYCLE": ArcosCommand(48, NUMBER, "time of one sonar, ms"),
    "MOVINGBLINK": ArcosCommand(49, NUMBER, "lamp while moving (PatrolBot)"),
    "HOSTBAUD": ArcosCommand(50, NUMBER, "speed of this line: 0..4 for 9600..115200"),
    "AUX1BAUD": ArcosCommand(51, NUMBER, "speed of AUX1"),
    "AUX2BAUD": ArcosCommand(52, NUMBER, "speed of AUX2"),
    "AUX3BAUD": ArcosCommand(53, NUMBER, "speed of AUX3"),
    "E_STOP": ArcosCommand(55, NOTHING, "stop as hard as it can"),
    "E_STALL": ArcosCommand(56, NUMBER, "the STOP button counts as a stall"),
    "GYRO": ArcosCommand(58, NUMBER, "gyro packets on, off"),
    "BATTERYINFO": ArcosCommand(62, NUMBER, "battery packets: 0 none, 1 one, 2 all"),
    "CHARGE": ArcosCommand(68, NUMBER, "docking: 1 deploy, 0 release"),
    "ROTKP": ArcosCommand(82, NUMBER, "rotation: proportional gain"),
    "ROTKV": ArcosCommand(83, NUMBER, "rotation: differential gain"),
    "ROTKI": ArcosCommand(84, NUMBER, "rotation: integral gain"),
    "TRANSKP": ArcosCommand(85, NUMBER, "translation: proportional gain"),
    "TRANSKV": ArcosCommand(86, NUMBER, "translation: differential gain"),
    "TRANSKI": ArcosCommand(87, NUMBER, "translation: integral gain"),
    "REVCOUNT": ArcosCommand(88, NUMBER, "differential encoder count of a revolution"),
    "DRIFTFACTOR": ArcosCommand(89, NUMBER, "drift factor"),
    "SOUND": ArcosCommand(90, NUMBER, "play a sound (AmigoBot)"),
    "PLAYLIST": ArcosCommand(91, NUMBER, "play a list of sounds (AmigoBot)"),
    "SOUNDTOG": ArcosCommand(92, NUMBER, "buzzer on, off"),
    "TICKSMM": ArcosCommand(93, NUMBER, "encoder ticks per mm"),
    "POWER_PC": ArcosCommand(95, NUMBER, "power of the computer"),
    "POWER_LRF": ArcosCommand(96, NUMBER, "power of the laser"),
    "POWER_5V": ArcosCommand(97, NUMBER, "auxiliary 5 V"),
    "POWER_12V": ArcosCommand(98, NUMBER, "auxiliary 12 V"),
    "LATVEL": ArcosCommand(110, NUMBER, "sideways speed (Seekur), mm/s"),
    "LATACCEL": ArcosCommand(113, NUMBER, "sideways acceleration (Seekur), mm/s2"),
    "SIM_RESET": ArcosCommand(225, NOTHING, "simulator: to the start"),
    "SIM_LRF_ENABLE": ArcosCommand(230, NUMBER, "simulator: laser packets 0 none, 1 short, 2 long"),
    "SIM_STAT": ArcosCommand(237, NOTHING, "simulator: where the robot really is"),
    "BATTEST": ArcosCommand(250, NUMBER, "pretend this battery voltage, 0.1 V; 0 for the real one"),
    "RESET": ArcosCommand(253, NOTHING, "reset the controller"),
}
"""All commands but those of the arm, and but MAINTENANCE (255), which must never be sent."""

DRIVING: Final = frozenset(
    {"OPEN", "CLOSE", "ENABLE", "MOVE", "ROTATE", "VEL", "HEAD", "DHEAD", "RVEL", "DCHEAD", "VEL2"}
    | {"HOSTBAUD", "RESET", "LATVEL", "GRIPPER"}
)
"""The commands that only the driver sends: it must know the commanded speeds and the state of the connection."""
RAMPS: Final = frozenset({"SETA", "SETRA"})
"""The commands of the slots ``acceleration`` and ``deceleration``, which keep the brakes as strong as the robot's
own."""
GAINS: Final = frozenset({"ROTKP", "ROTKV", "ROTKI", "TRANSKP", "TRANSKV", "TRANSKI"})
"""The gains of the speed control: without them the robot neither drives nor brakes."""

GRIPPER: Final = "gripper"
"""The device of the gripper in the worker."""
OPEN, CLOSE, HALT_PADDLES, UP, DOWN, HALT_LIFT, STORE, DEPLOY, HALT = 1, 2, 3, 4, 5, 6, 7, 8, 15
"""The arguments of the command GRIPPER."""
GRIPPER_HALTS: Final = frozenset({HALT_PADDLES, HALT_LIFT, HALT})
"""The commands of the gripper that move nothing."""

_LEAST_AND_MOST: Final = {NUMBER: (-LARGEST, LARGEST), WORD: (0, 0xFFFF)}


def encode(name: str, value: int | bytes | None = None) -> bytes:
    """Return the packet of a command.  Raises BadValue for an unknown name or an argument of another kind."""
    row = COMMANDS.get(name)
    if row is None:
        raise BadValue(f"ARCOS has no command {name!r}; there are: {', '.join(sorted(COMMANDS))}")
    fits = {
        NOTHING: value is None,
        STRING: isinstance(value, bytes),
        NUMBER: isinstance(value, int),
        WORD: isinstance(value, int),
    }[row.takes]
    if not fits:
        raise BadValue(f"{name} ({row.meaning}) takes {row.takes}, not {_in_words(value)}")
    if isinstance(value, int):
        least, most = _LEAST_AND_MOST[row.takes]
        if not least <= value <= most:
            raise BadValue(f"{name} ({row.meaning}) takes {row.takes} from {least} to {most}, not {value}")
    return command(row.number, value)


def _in_words(value: object) -> str:
    """Return the argument of a command as a program writes it."""
    if value is None:
        return "nil"
    if isinstance(value, str):
        return f'"{value}"'
    return f"the bytes {list(value)}" if isinstance(value, bytes) else str(value)


def wheels(left: int, right: int) -> int:
    """Return the argument of VEL2 for two wheels, in units of the robot's Vel2Divisor (-126..126).  Raises BadValue."""
    for name, value in (("left", left), ("right", right)):
        if not -126 <= value <= 126:
            raise BadValue(f"VEL2: {name} wheel {value} is not from -126 to 126")
    return (left & 0xFF) << 8 | right & 0xFF
