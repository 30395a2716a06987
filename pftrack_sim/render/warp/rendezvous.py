"""Rendezvous: many tasks run until each needs a drawing, all of these are drawn in one call, and the tasks go on.

Each task is a greenlet: it is suspended in the middle of whatever asked for the drawing, so that the code of a single
world draws many worlds together without knowing of it. One task runs at a time, in the thread of the caller.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar, cast

from greenlet import getcurrent, greenlet

Request = TypeVar("Request")
Reply = TypeVar("Reply")
Result = TypeVar("Result")


class Rendezvous(Generic[Request, Reply]):
    """Runs tasks in turns.

    Args:
        answer: Answers the requests of several tasks, in their order.
    """

    def __init__(self, answer: Callable[[Sequence[Request]], list[Reply]]) -> None:
        self._answer = answer
        self._meeting: greenlet | None = None

    def run(self, tasks: Sequence[Callable[[], Result]]) -> list[Result]:
        """Results of the tasks. An error of one ends the others where they wait, and is raised."""
        runners = [greenlet(task) for task in tasks]
        results: dict[int, Result] = {}
        before, self._meeting = self._meeting, getcurrent()
        try:
            turns: list[tuple[int, tuple[Reply, ...]]] = [(index, ()) for index in range(len(tasks))]
            while turns:
                requests: dict[int, Request] = {}
                for index, reply in turns:
                    given = cast("Any", runners[index]).switch(*reply)
                    if runners[index].dead:
                        results[index] = given
                    else:
                        requests[index] = given
                replies = self._answer(list(requests.values())) if requests else []
                turns = [(index, (reply,)) for index, reply in zip(requests, replies, strict=True)]
        finally:
            self._meeting = before
            for runner in runners:
                if not runner.dead:
                    runner.throw()
        return [results[index] for index in range(len(tasks))]

    def ask(self, request: Request) -> Reply:
        """The answer to a request: with those of all other tasks within a task of `run`, elsewhere at once."""
        meeting = self._meeting
        if meeting is not None and getcurrent().parent is meeting:
            return cast("Any", meeting).switch(request)
        return self._answer([request])[0]
