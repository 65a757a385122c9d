"""The Nao of Aldebaran: joints, hands, walking, lights, sensors and speech, through NAOqi 2.

Reading order: ``platform.toml``, ``reading`` (what is read of ALMemory), ``orders`` (what is written to joints),
``finding`` (what there is), ``exchange`` and ``part`` (what the parts of the driver share), ``joint_part``,
``walk_part``, ``light_part``, ``sense_part``, ``call_part``, ``driver`` (who speaks to NAOqi, in the worker's process,
by ``urbihw_nao.qimessaging``), ``robot`` with ``joints``, ``devices`` and ``lights`` (the objects of urbiscript),
``nao.u`` (proxies of services), ``tree.u`` (the standard robot API, groups).

Joints: ``joint_part`` with ``joint_writer`` (setAngles), ``dcm_writer``, ``dcm_course``, ``dcm_clock`` (the DCM) and
``motor_trace``; ``motor_control`` and ``motors.u``.  Hands in space: ``wholebody_part``.  Steps: ``gait``.  Limits of
calls: ``call_limits``.

Sound: ``sound_part``, ``micro_part``, ``sound`` (loudspeakers, microphone, voice, recognition of speech) with
``service_slot``.  What programs follow of ALMemory: ``memory``.

Pictures: ``pictures`` (formats), ``camera_part``, ``camera``.

Modules of NAOqi in urbiscript: ``module_part`` with ``module_help`` (registered, calls passed on), ``http_visitor``
with ``literals`` (calls by HTTP), ``modules`` and ``almodule.u``.

Beside them: ``old_names`` (of NAOqi 1), ``http_request`` (strict), ``watchdog`` and ``watchdog_part`` (the program on
the robot, and who feeds it).
"""
