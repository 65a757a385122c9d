"""One connection for several threads: one watches, the other one moves."""

import threading

import urbihw

with urbihw.connect() as robot:
    samples = robot.watch("motor6.val", hz=50)
    seen: list[float] = []
    watcher = threading.Thread(target=lambda: seen.extend(values[0] for _, values in samples))
    watcher.start()
    for step in range(5):
        robot.motor6.val = step / 10
        robot.run("sleep(30ms)")
    samples.close()
    watcher.join()
    print("seen:", len(seen) > 3)
