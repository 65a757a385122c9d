"""A simulated LEGO MINDSTORMS NXT: the brick with its motors, sensors and files, on USB or behind a serial line.

Typed from the brick's published firmware and checked against `captures/nxt.hex`.  Reading order: `codes` (numbers
of the protocol), `motor`, `inputs` (analog ports) and `lowspeed` (I2C), `files`, `direct` and `system` (one function
per command), `brick` (the brick executes telegrams), `tribot` (a brick on wheels in front of a wall), `stream`
(the brick as a `Device`), then the transports: `usb_endpoint` and, on the side of the host, `usb_backend`, which pyusb
uses in place of libusb.

    python -m urbihw_fakes nxt --usb       # prints a url such as usb://0694:0002?backend=...&at=/tmp/usb-bus-4242
    python -m urbihw_fakes nxt --pty       # the framing of Bluetooth on a pseudo terminal

Not modelled: programs do nothing when they run; input and output maps of the firmware's modules; RCX temperature and
rotation sensors; synchronised motors beyond their turn ratio; gear play, load and the supply's sag; the
turn-round time of Bluetooth.
"""
