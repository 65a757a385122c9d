"""The way in that stays: one process that owns a robot and serves it to whoever connects.

Reading order: ``service`` (start, reload, stop), ``config`` (its settings), ``notify`` (what the service manager is
told), ``fake`` (the robot in software beside it), ``holders`` (who has the port that we wanted), ``banner``.
"""
