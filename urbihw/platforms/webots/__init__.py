"""A simulated world behind the daemon: a MuJoCo model, or a robot of Webots.

Reading order: ``platform.toml``, ``simulator`` (what a simulation is to us: devices by name, steps, orders, samples),
its two back ends ``mujoco_world`` (with ``mujoco_motors`` and ``mujoco_sensors``) and ``controller``, ``port`` (their
urls), ``driver`` (in the worker's process: steps and orders), ``robot`` (the object ``webots``, and the time of the
programs), ``motors``, ``sensors``, ``media``, ``supervisor`` (the classes of the manual), ``webots.u`` (their
constructors); then ``worlds``.  Nothing else imports mujoco or the package of Webots.

Beside them: ``surface`` (what devices see of the simulation), ``scene`` (its film), ``blobs`` and ``mujoco_light`` (two
sensors), ``model_check`` and ``model_trial`` (models tried in a process of their own), ``controller_process`` (a robot
of Webots, likewise).
"""
