"""A Nao: NAOqi's services over QiMessaging, and the body behind them.

``codec`` (values and messages), ``body`` (joints, walking, falling), ``services`` (how a service is declared), one
module for each service, ``server`` (who calls what on which connection), ``device`` (the robot as a whole),
``endpoint`` (TCP, several connections).

How to add a service: a module with a class that derives from `services.Service`, and one line in the table of services
in `device.Nao`.  ``name`` is its name in NAOqi; a method is marked with its NAOqi name and its signatures (those of
``codec``), a signal is a class attribute::

    class Compass(Service):
        name = "ALCompass"
        turned = Signal("turned", "(f)")

        def __init__(self, body: Body) -> None:
            super().__init__()
            self.body = body

        @method("getHeading", "(b)", "f")
        def get_heading(self, sensors: bool) -> float:
            return self.body.heading

A method gets decoded arguments and returns its result; or a `Later` if NAOqi's own blocks; or raises `Failed`, whose
text the caller gets.  Several marks on one method are overloads or other names.  ``self.emit(self.turned, 0.5)`` sends
a signal.  A method that returns an object (signature ``o``) passes a `Service` to ``add_object`` once and returns its
``reference()``.  What a service needs (body, memory, ``read_clock``, another service) it gets by its constructor.
"""
