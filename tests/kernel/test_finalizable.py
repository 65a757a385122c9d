"""Many Finalizables that end together, and the jobs that finalize them."""

from __future__ import annotations

from time import process_time

from urbihw.kernel import Kernel

MORTAL = """
    class Global.Mortal {
      function 'new'(n) { do (Finalizable.new) { var name = n; function finalize() { echo(name) } } }
    }|;
    """


def test_many_that_end_at_once_cost_no_more_each_than_few() -> None:
    kernel = Kernel(fast=True)
    lobby = kernel.open_lobby()
    kernel.run_text(lobby, "var l = []|;")

    def cost(number: int) -> float:
        """The processor time of the end of so many objects, in seconds."""
        kernel.run_text(lobby, f"l = []|; for| ({number}) l << Finalizable.new|;")
        begin = process_time()
        kernel.run_text(lobby, "l = 0|;")
        return process_time() - begin

    few, many = (min(cost(number) for _ in range(3)) for number in (500, 3000))
    assert many < 15 * few


def test_an_object_whose_job_was_refused_leaves_the_others_theirs() -> None:
    kernel = Kernel(fast=True)
    lobby = kernel.open_lobby()
    kernel.run_text(lobby, MORTAL)
    scheduler = kernel.scheduler
    scheduler.shares.max_of_one = scheduler.shares.of(lobby) + 3
    text = """
        for (var round = 0; round < 2; round += 1) {
          var l = []|
          for| (var i = 0; i < 5 - 3 * round; i += 1) l << Mortal.new(round * 10 + i)|
          l = 0;
          sleep(1s);
        };
        """
    lines = kernel.run_text(lobby, text).splitlines()
    assert [line.split("*** ")[1] for line in lines if "***" in line] == ["1", "2", "3", "4", "10", "11"]
