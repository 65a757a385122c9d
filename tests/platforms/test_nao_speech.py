"""The voice of a Nao, recognition of speech, and behaviours."""

from __future__ import annotations

import pytest
from nao_lab import Lab, stand

from urbihw_nao_fakes.device import Nao


def replug(lab: Lab) -> None:
    """The network is lost for a second."""
    lab.unplug()
    lab.run(1)
    lab.end.replug()
    lab.until(lambda: lab.look("nao.link") == "true")
    lab.run(0.5)


# ---------------------------------------------------------------- the voice


def test_say_waits_and_only_its_statement() -> None:
    lab = Lab.ready()
    lab.say('tts.say("one two three four five"); echo("said"),', 1)
    assert lab.heard() == "" and lab.look("1 + 1") == "2"
    lab.run(1.5)
    assert lab.heard() == "*** said"
    lab.say('robot.voice.say("six seven"),', 0.5)
    assert lab.device.speech.said == ["one two three four five", "six seven"]


def test_a_stop_of_the_robot_lets_it_speak_and_stop_all_ends_it() -> None:
    lab = Lab.ready()
    lab.say('tts.say("one two three four five") | echo("said"),', 0.5)
    assert lab.say("robot.stop;", 0.5) == "" and lab.device.speech.cut_short == []
    assert lab.say("tts.stopAll;", 0.3) == "*** said"
    assert lab.device.speech.cut_short == ["one two three four five"]


def test_settings_of_the_voice() -> None:
    lab = Lab.ready()
    lab.run(0.3)
    assert lab.look("[tts.volume, tts.lang, tts.speed, tts.pitch, tts.voice]") == (
        '[0.7, "en", 1, 1, "Kenny22Enhanced"]'
    )
    lab.say('tts.volume = 0.3; tts.lang = "fr"; tts.speed = 1.5; tts.pitch = 1.2; tts.voice = "Julie22Enhanced";', 0.3)
    speech = lab.device.speech
    assert speech.volume == pytest.approx(0.3)
    assert (speech.language, speech.voice) == ("French", "Julie22Enhanced")
    assert speech.parameters["speed"] == 150 and speech.parameters["pitchShift"] == pytest.approx(1.2)
    lab.say('tts.setVolume(0.5); tts.setParameter("doubleVoice", 1);', 0.3)
    assert speech.parameters["doubleVoice"] == 1.0
    replug(lab)
    assert lab.number("tts.volume") == 0.5  # read again


def test_a_language_that_is_not_there(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    lab.say('tts.lang = "de";', 0.3)
    assert "lang: not set: ALTextToSpeech: the language German is not installed" in caplog.text
    assert lab.look("tts.lang") == '"en"'
    assert "a language is a code of ISO 639" in lab.say("tts.lang = 5;", 0.1)


def test_events_of_the_voice() -> None:
    lab = Lab.ready()
    lab.say('var Global.began = nao.memoryEvent("ALTextToSpeech/TextStarted")|;', 0.2)
    lab.say('var Global.done = nao.memoryEvent("ALTextToSpeech/TextDone")|;', 0.2)
    lab.say('at (began?(var x)) echo("began"); at (done?(var x)) echo("done");')
    assert lab.say('tts.say("one two"),', 0.3) == "*** began"
    lab.run(1)
    assert lab.heard() == "*** done"


def test_a_robot_without_a_voice() -> None:
    device = Nao()
    for service in (device.speech, device.recognition):
        del device.services[service.number]
    lab = Lab.ready(device)
    assert "volume: this robot has no ALTextToSpeech" in lab.say("tts.volume = 1;", 0.2)
    assert "say: this robot has no ALTextToSpeech" in lab.say('tts.say("hello");', 0.2)
    assert "this robot has no ALSpeechRecognition" in lab.say('speech.setVocabulary(["yes"]);', 0.5)
    assert lab.look('robot.hasSlot("voice")') == "false"


# ---------------------------------------------------------------- recognition


HEARING = 'speech.setVocabulary(["yes", "no"]); at (robot.speech.hear?(var word)) echo([word, speech.confidence]);'


def test_words_are_heard_while_it_listens() -> None:
    lab = Lab.ready()
    lab.say(HEARING, 0.3)
    assert lab.console().line("hear yes 0.7") == "not heard"
    lab.say("speech.start;", 0.5)
    assert lab.device.recognition.subscribers == {"urbihw"} and lab.look("speech.on") == "true"
    assert lab.console().line("hear yes 0.5 no 0.25") == "ok"
    lab.run(0.2)
    assert lab.heard() == '*** ["yes", 0.5]'
    assert lab.console().line("hear perhaps 0.9") == "not heard"
    lab.say("speech.stop;", 0.3)
    assert lab.device.recognition.subscribers == set() and lab.look("speech.on") == "false"
    assert lab.console().line("hear yes 0.7") == "not heard"


def test_another_vocabulary_while_it_listens() -> None:
    lab = Lab.ready()
    lab.say(HEARING + " speech.start;", 0.5)
    assert lab.say('speech.setVocabulary(["stop"], true);', 0.5) == ""
    assert lab.look("speech.vocabulary") == '["stop"]' and not lab.device.recognition.paused
    assert lab.console().line("hear stop 0.5") == "ok"
    lab.run(0.2)
    assert lab.heard() == '*** ["stop", 0.5]'  # without the marks of word spotting


def test_it_listens_again_after_a_lost_link_and_a_restart() -> None:
    lab = Lab.ready()
    lab.say(HEARING + " speech.start;", 0.5)
    replug(lab)
    assert lab.console().line("hear no 0.5") == "ok"
    lab.run(0.2)
    assert lab.heard() == '*** ["no", 0.5]'
    lab.unplug()
    lab.device.recognition.subscribers.clear()
    lab.device.recognition.vocabulary.clear()
    lab.run(1)
    lab.end.replug()
    lab.until(lambda: lab.console().line("hear yes 0.5") == "ok")
    lab.run(0.2)
    assert lab.heard() == '*** ["yes", 0.5]'


def test_mistakes_are_errors_of_one_line() -> None:
    lab = Lab.ready()
    assert "say first what to recognize: setVocabulary" in lab.say("speech.start;", 0.3)
    assert "a vocabulary is a list of 1 to 1000 words" in lab.say("speech.setVocabulary([]);", 0.3)
    assert "a vocabulary is a list of 1 to 1000 words" in lab.say("speech.setVocabulary([5]);", 0.3)
    lab.say('speech.lang = "fr";', 0.3)
    assert lab.device.recognition.language == "French"


@pytest.mark.parametrize("value", [[], ["yes"], [5, 6], ["x" * 500, 0.5], "yes", 7, ["yes", "no"], [["yes"], 0.5]])
def test_what_is_no_word_is_not_heard(value: object) -> None:
    lab = Lab.ready()
    lab.say(HEARING + " speech.start;", 0.5)
    lab.device.memory.raise_event("WordRecognized", value)
    lab.run(0.2)
    assert lab.heard() == ""


# ---------------------------------------------------------------- behaviours


def test_behaviours_are_run_and_stopped() -> None:
    lab = Lab.ready()
    lab.say("head.load = 1;", 0.2)
    assert lab.say("ALBehaviorManager.getInstalledBehaviors.size;", 0.2) == "3"
    lab.say('ALBehaviorManager.runBehavior("animations/nod") | echo("nodded"),', 0.5)
    assert lab.device.body.joints["HeadPitch"].angle == pytest.approx(0.3, abs=0.01)
    assert lab.say("ALBehaviorManager.getRunningBehaviors;", 0.2) == '["animations/nod"]'
    lab.run(2)
    assert lab.heard() == "*** nodded" and lab.device.behaviours.finished == ["animations/nod"]
    answer = lab.say('ALBehaviorManager.runBehavior("nothing");', 0.3)
    assert "ALBehaviorManager: behavior nothing is not installed" in answer and ".cpp" not in answer


def test_a_stop_ends_the_behaviours_also_those_that_somebody_else_has_begun() -> None:
    lab = Lab.ready()
    stand(lab.device.body)
    lab.device.behaviours.start("dialog/wait")  # of somebody else
    lab.run(0.2)
    lab.say('ALBehaviorManager.startBehavior("animations/wave"); ALBehaviorManager.runBehavior("animations/nod"),', 0.3)
    lab.say("robot.stop;", 0.3)
    assert set(lab.device.behaviours.stopped) == {"dialog/wait", "animations/wave", "animations/nod"}
    assert lab.device.behaviours.get_running() == []
    place = lab.device.body.joints["RShoulderPitch"].angle
    lab.run(2)
    assert lab.device.body.joints["RShoulderPitch"].angle == pytest.approx(place, abs=0.02)
