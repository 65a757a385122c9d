"""What is heard and said: the loudspeakers, the microphone, the voice, and the recognition of speech."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any, Final

from urbihw.buses.messages import Reply
from urbihw.kernel.uobject import UObject, USound, event, finite_number, function, owned, reading, set_range
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.speaker import PlatformSpeaker
from urbihw.platforms.streamed import Streamed
from urbihw_nao import words
from urbihw_nao.micro_part import HEAR_RATE, MICRO
from urbihw_nao.service_slot import ServiceSlot, Setting
from urbihw_nao.sound_part import AUDIO, PLAY_RATE

VOICE, RECOGNITION = "ALTextToSpeech", "ALSpeechRecognition"
WORD_EVENT: Final = "WordRecognized"
SUBSCRIBER: Final = "urbihw"
"""The name under which ALSpeechRecognition listens for us."""
MOST_WORDS: Final = 1000
LONGEST_WORD: Final = 200
"""Characters of a word or phrase that was recognized; a longer one is not accepted."""
LANGUAGES: Final = {
    "ar": "Arabic", "cs": "Czech", "da": "Danish", "de": "German", "el": "Greek", "en": "English", "es": "Spanish",
    "fi": "Finnish", "fr": "French", "it": "Italian", "ja": "Japanese", "ko": "Korean", "nl": "Dutch",
    "no": "Norwegian", "pl": "Polish", "pt": "Portuguese", "ru": "Russian", "sv": "Swedish", "tr": "Turkish",
    "zh": "Chinese",
}  # fmt: skip
"""ISO 639 -> the name of the language in NAOqi; other names of NAOqi, such as Brazilian, are taken as they are."""
_CODES: Final = {name: code for code, name in LANGUAGES.items()}


def language_name(value: Any) -> str:
    """The name in NAOqi of a language.  Raises ValueError."""
    if not isinstance(value, str) or not value:
        raise ValueError('a language is a code of ISO 639, such as "en", or its name in NAOqi, such as "English"')
    return LANGUAGES.get(value, value)


def language_code(name: Any) -> str:
    """The code of a language of NAOqi, its name if it has none.  Raises TypeError."""
    if not isinstance(name, str):
        raise TypeError("no name")
    return _CODES.get(name, name)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError("this slot takes a String")
    return value


def _percent(value: Any) -> int:
    return round(finite_number(value))


OUTPUT_VOLUME: Final = Setting(AUDIO, ("getOutputVolume",), ("setOutputVolume",), _percent)
"""Percent."""
VOICE_SETTINGS: Final = {
    "volume": Setting(VOICE, ("getVolume",), ("setVolume",)),
    "lang": Setting(VOICE, ("getLanguage",), ("setLanguage",), language_name, language_code),
    "voice": Setting(VOICE, ("getVoice",), ("setVoice",), _text, _text),
    "speed": Setting(
        VOICE, ("getParameter", "speed"), ("setParameter", "speed"), lambda value: finite_number(value) * 100,
        lambda value: float(value) / 100,
    ),
    # 0 switches the change of pitch off.
    "pitch": Setting(
        VOICE, ("getParameter", "pitchShift"), ("setParameter", "pitchShift"), finite_number,
        lambda value: float(value) or 1.0,
    ),
}  # fmt: skip
"""Slots of the voice (manual, "TextToSpeech"; NAOqi, "ALTextToSpeech")."""


class NaoSpeaker(PlatformSpeaker):
    """The loudspeakers of a Nao; ``nao.volume`` is how loud they are."""

    play_rate = PLAY_RATE


class NaoMicro(Streamed):
    """The microphone at the front: ``val`` is what was heard since the last change, 16000 samples a second of 16 bits.

    ``duration`` (ms) is how long that is.  It is on while somebody reads or follows ``val``; the sound comes in pieces
    of 170 ms.
    """

    nothing = USound.of(b"", 1, HEAR_RATE, 16)
    duration = reading(0.0)

    def switch_stream(self, on: bool) -> None:
        """Watch it, or no longer."""
        self.channel.watch(MICRO, ("val",), 0.0 if on else None)

    def show(self, data: bytes, stamp: float) -> None:
        """Show what was heard."""
        sound = USound.of(data, 1, HEAR_RATE, 16)
        self.duration.sense(sound.duration * 1000)
        self.val.sense(sound, stamp)


class NaoVoice(UObject):
    """The voice (ALTextToSpeech): ``volume`` (0 to 1), ``lang`` (ISO 639), ``voice`` (its name), ``speed`` and
    ``pitch`` (1 is regular).  The methods of the service are slots too: ``say``, ``stopAll`` and others.
    """

    slot_words = words.VOICE

    volume = owned(math.nan)
    lang = owned("")
    voice = owned("")
    speed = owned(1.0)
    pitch = owned(1.0)

    def init(self, channel: DeviceChannel, log: DeviceLog) -> None:
        """Speak to the worker through ``channel``."""
        set_range(self.volume, 0.0, 1.0)
        set_range(self.speed, 0.5, 4.0)
        set_range(self.pitch, 1.0, 4.0)
        rows = VOICE_SETTINGS.items()
        self._slots = [ServiceSlot(self, getattr(self, name), setting, channel, log) for name, setting in rows]

    def connect(self, services: Collection[str]) -> None:
        """The robot was found."""
        for slot in self._slots:
            slot.connect(services)


class NaoSpeech(UObject):
    """The recognition of speech (ALSpeechRecognition): ``hear`` is emitted with each word of ``vocabulary`` that was
    recognized while it is ``on``; ``confidence`` (0 to 1) is how likely that is, ``lang`` (ISO 639) the language.

    ``setVocabulary``, ``start`` and ``stop`` are in ``nao.u``.
    """

    slot_words = words.SPEECH

    hear = event()
    confidence = reading(0.0)
    vocabulary = reading()
    on = reading(False)
    lang = owned("")

    def init(self, channel: DeviceChannel, log: DeviceLog) -> None:
        """Speak to the worker through ``channel``."""
        self._channel, self._log = channel, log
        self._words: list[str] = []
        self._spotting = self._is_there = False
        self.vocabulary.sense([])
        setting = Setting(RECOGNITION, ("getLanguage",), ("setLanguage",), language_name, language_code)
        self._slot = ServiceSlot(self, self.lang, setting, channel, log)

    def connect(self, services: Collection[str]) -> None:
        """The robot was found: if it was listening, it shall again, whether NAOqi has been restarted or not."""
        self._slot.connect(services)
        self._is_there = RECOGNITION in services
        if self.on.sensed and self._is_there:
            # An earlier subscription would refuse the words.
            self._call_next([
                ("unsubscribe", [SUBSCRIBER]), ("setVocabulary", [self._words, self._spotting]),
                ("subscribe", [SUBSCRIBER]),
            ])  # fmt: skip

    def _call_next(self, rows: Sequence[tuple[str, list[Any]]]) -> None:
        if not rows:
            return
        (method, arguments), *others = rows

        def done(reply: Reply) -> None:
            if not reply.ok and method != "unsubscribe":
                self._log.warning("speech: %s: %s", method, reply.error)
            self._call_next(others)

        self._channel.call(RECOGNITION, method, arguments, done)

    @function("checkWords")
    def check_words(self, words: list[Any]) -> None:
        """Raise an error if these are no words to recognize, or the robot recognizes none."""
        if not self._is_there:
            raise ValueError(f"this robot has no {RECOGNITION}")
        if not words or len(words) > MOST_WORDS or not all(isinstance(word, str) and word for word in words):
            raise ValueError(f"a vocabulary is a list of 1 to {MOST_WORDS} words or phrases")

    @function
    def remember(self, words: list[str], spotting: bool) -> None:
        """The robot has this vocabulary now."""
        self._words, self._spotting = list(words), spotting
        self.vocabulary.sense(self._words)

    @function("setOn")
    def set_on(self, on: bool) -> None:
        """The robot listens now, or no longer."""
        self.on.sense(on)

    def show(self, value: Any) -> None:
        """What WordRecognized says: a word and its confidence, then less likely ones."""
        if not self.on.sensed or not isinstance(value, list | tuple) or len(value) < 2:
            return
        word, confidence = value[:2]
        if not isinstance(word, str) or len(word) > LONGEST_WORD or not isinstance(confidence, int | float):
            return
        # So a word is marked that was spotted within others.
        word = word.replace("<...>", "").strip()
        if word and math.isfinite(confidence):
            self.confidence.sense(float(confidence))
            self.hear.emit(word)
