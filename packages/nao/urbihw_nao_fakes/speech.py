"""ALTextToSpeech and ALSpeechRecognition: what the robot says, and what it understands."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from urbihw_nao_fakes.memory import Memory
from urbihw_nao_fakes.services import Failed, Later, Service, as_list, method

LANGUAGES = ("English", "French")
VOICES = ("Kenny22Enhanced", "Julie22Enhanced")
PARAMETERS = {
    "pitchShift": 1.0, "doubleVoice": 0.0, "doubleVoiceLevel": 0.0, "doubleVoiceTimeShift": 0.0, "speed": 100.0,
}  # fmt: skip
WORDS_A_SECOND = 2.5
EVENTS = "ALTextToSpeech/"


@dataclass(eq=False)
class Sentence:
    """A text to say; it takes ``seconds``, and is said since ``began``."""

    text: str
    seconds: float
    began: float | None = None
    over: bool = False


class LanguageService(Service):
    """What both services have: the language that they speak or understand."""

    def __init__(self) -> None:
        super().__init__()
        self.language = LANGUAGES[0]

    @method("setLanguage", "(s)")
    def set_language(self, language: str) -> None:
        """One of those that are installed.  Raises Failed."""
        if language not in LANGUAGES:
            raise Failed(f"{self.name}: the language {language} is not installed")
        self.language = language

    @method("getLanguage", "()", "s")
    def get_language(self) -> str:
        """The one it speaks or understands."""
        return self.language

    @method("getAvailableLanguages", "()", "[s]")
    def get_languages(self) -> list[str]:
        """The installed ones, by name."""
        return list(LANGUAGES)


class Speech(LanguageService):
    """ALTextToSpeech; one text is said behind the other.

    Attributes:
        said: the texts, in their order.
        cut_short: those of them that `stopAll` has ended.
        parameters: of the voice.
    """

    name = "ALTextToSpeech"

    def __init__(self, clock: Callable[[], float], memory: Memory) -> None:
        super().__init__()
        self.said: list[str] = []
        self.cut_short: list[str] = []
        self.volume, self.voice = 0.7, VOICES[0]
        self.parameters = dict(PARAMETERS)
        self._clock, self._memory = clock, memory
        self._queue: deque[Sentence] = deque()

    def advance(self, now: float) -> None:
        """Begin and end texts, and raise the events of both."""
        while self._queue:
            first = self._queue[0]
            if first.began is None:
                first.began = now
                self._memory.raise_event(EVENTS + "CurrentSentence", first.text)
                self._memory.raise_event(EVENTS + "TextStarted", 1)
            if now < first.began + first.seconds:
                return
            self._queue.popleft().over = True
            self._memory.raise_event(EVENTS + "TextDone", 1)

    def is_active(self) -> bool:
        """Whether the robot speaks at present."""
        return bool(self._queue)

    @method("say", "(s)")
    @method("say", "(ss)")
    def say(self, text: str, language: str = "") -> Later:
        """The answer comes when it is spoken, or stopped."""
        self.said.append(text)
        rate = WORDS_A_SECOND * self.parameters["speed"] / 100
        sentence = Sentence(text, len(text.split()) / rate)
        self._queue.append(sentence)
        self.advance(self._clock())
        return Later(lambda: sentence.over)

    @method("stopAll")
    def stop(self) -> None:
        """Be silent at once."""
        self.cut_short += [each.text for each in self._queue]
        if self._queue:
            self._memory.raise_event(EVENTS + "TextInterrupted", 1)
        for each in self._queue:
            each.over = True
        self._queue.clear()

    @method("setVolume", "(f)")
    def set_volume(self, volume: float) -> None:
        """Set the volume of speech, 0 to 1."""
        self.volume = volume

    @method("getVolume", "()", "f")
    def get_volume(self) -> float:
        """The volume of speech, 0 to 1."""
        return self.volume

    @method("setParameter", "(sf)")
    def set_parameter(self, name: str, value: float) -> None:
        """One of the voice.  Raises Failed."""
        if name not in PARAMETERS:
            raise Failed(f"ALTextToSpeech: no parameter {name}")
        self.parameters[name] = value

    @method("getParameter", "(s)", "f")
    def get_parameter(self, name: str) -> float:
        """One of the voice.  Raises Failed."""
        if name not in PARAMETERS:
            raise Failed(f"ALTextToSpeech: no parameter {name}")
        return self.parameters[name]

    @method("setVoice", "(s)")
    def set_voice(self, voice: str) -> None:
        """One of those that are installed.  Raises Failed."""
        if voice not in VOICES:
            raise Failed(f"ALTextToSpeech: the voice {voice} is not installed")
        self.voice = voice

    @method("getVoice", "()", "s")
    def get_voice(self) -> str:
        """The one it speaks with."""
        return self.voice

    @method("getAvailableVoices", "()", "[s]")
    def get_voices(self) -> list[str]:
        """The installed ones, by name."""
        return list(VOICES)


class Recognition(LanguageService):
    """ALSpeechRecognition: it understands words of its vocabulary, while somebody has subscribed.

    Attributes:
        vocabulary: the words; ``spotting``: whether it finds them within other words.
        subscribers: who wants it to listen.
        paused: it does not listen, and takes a new vocabulary.
    """

    name = "ALSpeechRecognition"

    def __init__(self, memory: Memory) -> None:
        super().__init__()
        self.vocabulary: list[str] = []
        self.spotting = self.paused = False
        self.subscribers: set[str] = set()
        self._memory = memory

    def hear(self, words: Sequence[tuple[str, float]]) -> bool:
        """Somebody says something: what it may have been, and how likely that is.  Returns whether it was heard."""
        known = [(word, confidence) for word, confidence in words if word in self.vocabulary]
        if self.paused or not self.subscribers or not known:
            return False
        form = "<...> {} <...>" if self.spotting else "{}"
        value: list[Any] = []
        for word, confidence in known:
            value += [form.format(word), confidence]
        self._memory.raise_event("WordRecognized", value)
        return True

    @method("setVocabulary", "(mb)")
    def set_vocabulary(self, words: Any, spotting: bool) -> None:
        """Words to understand.  Raises Failed while it listens."""
        if self.subscribers and not self.paused:
            raise Failed(
                "NuanceContext::addContext: A grammar cannot be set while the ASR engine is running\n\n  at x.cpp"
            )
        self.vocabulary, self.spotting = [str(word) for word in as_list(words)], spotting

    @method("pause", "(b)")
    def pause(self, on: bool) -> None:
        """Do not listen, or again."""
        self.paused = on

    @method("subscribe", "(s)")
    def subscribe(self, name: str) -> None:
        """Listen for one more.  Raises Failed without words to understand."""
        if not self.vocabulary:
            raise Failed("ALSpeechRecognition: no vocabulary is set")
        self.subscribers.add(name)

    @method("unsubscribe", "(s)")
    def unsubscribe(self, name: str) -> None:
        """Listen for one less."""
        self.subscribers.discard(name)
