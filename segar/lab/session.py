"""A session: experiments within the budget of a lab, predictions, questions and an answer; kept in a file, replayed to the bit.

All goes through :meth:`Session.do`, whose requests and replies are plain data: the protocol.
"""

import json
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO, TextIO

import numpy as np

from segar.errors import SegarError, did_you_mean, naming
from segar.evaluation import Interval
from segar.hardness import wilson_interval
from segar.lab.grading import Grader
from segar.lab.hidden_world import START_LEVELS, Lab
from segar.lab.laws import levels_of
from segar.lab.questions import Mark, Question, make_questions
from segar.levels import hash_of_levels
from segar.support import data_in, from_json, replacing, require_form, shown

LONGEST_REQUEST = 2**20  # [bytes]
FORMAT, VERSION = "segar-lab-session", 1
EXPERIMENT = {"level?": object, "set?": {str: {str: object}}, "actions?": object, "steps?": int}
FORMS: dict[str, dict[str, Any]] = {
    "language": {"do": str},
    "experiment": {"do": str, **EXPERIMENT},
    "predict": {"do": str, "law?": dict, "laws?": [dict], **EXPERIMENT},
    "answer": {"do": str, "law?": dict, "answers?": {str: object}},
}
"""The forms of requests; see :func:`segar.support.misfit`."""


class Session:
    """One experimenter in a lab.

    Attributes:
        lab: the hidden world.
        log: the requests that changed the session, each with its reply.
        left: steps of the budget that are left.
        recordings: what a passive lab gives: experiments with their observations.
        file: where the session is kept after each change; None: nowhere.
    """

    file: Path | None = None

    def __init__(self, lab: Lab) -> None:
        self.lab, self.log, self.left = lab, list[tuple[dict[str, Any], dict[str, Any]]](), lab.budget
        self.graded = self.is_over = False
        self.asked: dict[str, Question] = {}
        self.recordings = _recorded(self) if lab.passive else []

    def experiment(self, **experiment: Any) -> np.ndarray:
        """What is seen of an experiment, float64 ``(steps + 1, seen)``; ``(n, steps + 1, seen)`` where a value leads with
        the experiment.

        Args:
            level: in which it begins; one number, or one for each experiment.
            set: entity to factor to its value at the beginning, a number or two.
            actions: float ``(steps, action size)``, or steps: that pass without an action.

        Raises:
            SegarError: something of it is wrong, or costs more than is left; the budget stays as it is.
        """
        return self.do({"do": "experiment", **experiment})["observations"]

    def predict(self, law: Any, **experiment: Any) -> np.ndarray:
        """What would be seen if a law held, without noise and at no cost; for a list of laws, arrays lead with the law."""
        name = "laws" if isinstance(law, list) else "law"
        return self.do({"do": "predict", name: law, **experiment})["observations"]

    def answer(self, **answer: Any) -> dict[str, Any]:
        """The grade of ``law=``, or the marks of ``answers=`` to questions; without either, the questions."""
        return self.do({"do": "answer", **answer})

    def do(self, request: Any) -> dict[str, Any]:
        """The reply to a request of the protocol; raises :class:`SegarError`, and then nothing has changed."""
        kind = request.get("do") if isinstance(request, dict) else None
        if kind not in FORMS:
            said = f"'do' must be one of {', '.join(FORMS)}, not {shown(kind)}"
            raise SegarError(said + (did_you_mean(kind, FORMS) if isinstance(kind, str) else ""))
        require_form(request, FORMS[kind], only=True)
        reply = getattr(self, f"_{kind}")(request)
        if kind in ("experiment", "answer"):
            self.log.append((request, reply))
            if self.file is not None:
                self.save(self.file)
        return reply

    def reply(self, line: bytes) -> str:
        """The reply to a request in JSON, in JSON; what is wrong with it stands under ``error``."""
        try:
            if len(line) > LONGEST_REQUEST:
                raise SegarError(f"a request may have {LONGEST_REQUEST} bytes, and this one has more")
            return _json(self.do(from_json(line)))
        except SegarError as error:
            return _json({"error": str(error)})
        except ValueError as error:
            return _json({"error": f"the request is no JSON: {error}"})

    def serve(self, requests: BinaryIO, replies: TextIO) -> None:
        """Answer requests, a line of JSON each, until there are no more."""
        while line := requests.readline(LONGEST_REQUEST + 1):
            while len(line) > LONGEST_REQUEST and not line.endswith(b"\n"):
                line = line[:LONGEST_REQUEST] + requests.readline(LONGEST_REQUEST + 1)
            print(self.reply(line), file=replies, flush=True)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the session to a file, a line of JSON for the lab and for each request with its reply; raises
        :class:`SegarError`. The file names the hidden world, so keep it from the experimenter."""
        lines = [self._head(), *({"request": request, "reply": reply} for request, reply in self.log)]
        with replacing(Path(path), "the session") as beside:
            beside.write_text("".join(f"{_json(line)}\n" for line in lines), encoding="ascii")

    @classmethod
    def load(cls, path: str | PathLike[str], lab: Lab) -> "Session":
        """The session in a file, in the lab in which it was begun. Every request is done again.

        Raises:
            SegarError: there is no such file, it is no session in this lab, or a reply is another one now.
        """
        path = Path(path)
        lines = data_in(path, "a session", SegarError, lambda text: [from_json(line) for line in text.splitlines()])
        session = cls(lab)
        head = from_json(_json(session._head()).encode())
        if not lines or lines[0] != head:
            raise SegarError(f"{path} is no session in this lab, whose first line would be {_json(head)}")
        for number, line in enumerate(lines[1:], 2):
            with naming(f"{path}: line {number}"):
                require_form(line, {"request": dict, "reply": dict}, only=True)
                reply = _json(session.do(line["request"]))
            if reply != _json(line["reply"]):
                raise SegarError(f"{path}: line {number}: the reply to this request is another one now")
        return session

    def _head(self) -> dict[str, Any]:
        lab = self.lab
        names = ("world", "seed", "budget", "most_steps", "noise", "passive", "trusted", "questions")
        own = {"distribution": lab.distribution.hash, "levels": hash_of_levels(lab.levels), "seen": list(lab.places)}
        own["set"] = {f.__name__: bounds for f, bounds in lab.settable.items()}
        return {"format": FORMAT, "version": VERSION, **{name: getattr(lab, name) for name in names}, **own}

    def _language(self, request: Mapping[str, Any]) -> dict[str, Any]:
        return self.lab.language() | {"left": self.left, "recordings": self.recordings}

    def _experiment(self, request: Mapping[str, Any]) -> dict[str, Any]:
        if self.lab.passive:
            raise SegarError("this lab is passive: there are recordings, and no experiments")
        if self.is_over:
            raise SegarError("the experiments are over, since an answer was given or questions were asked for")
        level, values, actions, is_batch = read_experiment(self.lab, request, START_LEVELS, self.lab.most_steps)
        cost = len(level) * actions.shape[1]
        if cost > self.left:
            raise SegarError(f"the experiment costs {cost} steps, and {self.left} of the budget are left")
        shape = (len(level), actions.shape[1] + 1, len(self.lab.places))
        with ThreadPoolExecutor(1) as helper:  # draws beside the steps, which take four times as long
            noise = helper.submit(self.lab.noise_of, shape, len(self.log)) if self.lab.noise else None
            observations = self.lab.play(self.lab.hidden, level, values, actions).seen[0]
        if noise is not None:
            observations += noise.result()  # in place, because a new array takes longer than the sums
        self.left -= cost
        return {"observations": observations if is_batch else observations[0], "left": self.left}

    def _predict(self, request: Mapping[str, Any]) -> dict[str, Any]:
        if ("law" in request) == ("laws" in request):
            raise SegarError("a prediction needs 'law', or 'laws', and not both")
        levels, most_steps = len(self.lab.levels), self.lab.task.max_steps
        level, values, actions, is_batch = read_experiment(self.lab, request, levels, most_steps)
        laws = levels_of(self.lab, request.get("laws", [request.get("law")]))
        states = self.lab.play(laws, level, values, actions).seen
        states = states if is_batch else states[:, 0]
        return {"observations": states if "laws" in request else states[0]}

    def _answer(self, request: Mapping[str, Any]) -> dict[str, Any]:
        if "law" in request and "answers" in request:
            raise SegarError("an answer has 'law' or 'answers', and not both")
        if "law" in request:
            if self.graded:
                raise SegarError("a law was given already, and was graded")
            grade = Grader(self.lab).grade(request["law"])
            self.graded = self.is_over = True
            return {"grade": grade.data()}
        if "answers" not in request:
            self.is_over = True
            self.asked = self.asked or {question.ask["id"]: question for question in make_questions(self.lab)}
            return {"questions": [question.ask for question in self.asked.values()]}
        answers = request["answers"]
        for name in answers:
            if name not in self.asked:
                raise SegarError(f"'answers.{name}' answers no question that waits.{did_you_mean(name, self.asked)}")
        if not self.asked:
            raise SegarError("no question waits for answers; an answer without 'law' and 'answers' asks for questions")
        marks = {name: question.mark(answers.get(name)) for name, question in self.asked.items()}
        self.asked, shares = {}, dict[str, Any]()
        for part in Mark._fields:
            mean = float(np.mean([getattr(mark, part) for mark in marks.values()]))
            low, high = wilson_interval(mean, len(marks))  # of scores it is rather too wide
            shares[part] = Interval(mean, float(low), float(high))._asdict()
        return {"marks": {name: mark._asdict() for name, mark in marks.items()}, **shares}


def read_experiment(
    lab: Lab, request: Mapping[str, Any], levels: int, most_steps: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """An experiment from data: level int ``(n,)``, first states float64 ``(n, entities, columns)``, actions float32
    ``(n, steps, action size)``, and whether ``n`` was given.

    Args:
        levels: how many levels may be named. most_steps: that may be taken.

    Raises:
        SegarError: something is wrong; the message names it.
    """
    size = len(lab.task.action_low)
    if ("actions" in request) == ("steps" in request):
        raise SegarError("an experiment needs 'actions', or 'steps' without actions, and not both")
    if "steps" in request:
        actions = np.zeros((np.clip(request["steps"], 0, most_steps + 1), size))
    else:
        actions = numbers(request["actions"], "actions", (-1, size), lab.task.action_low, lab.task.action_high)
    if not 1 <= actions.shape[-2] <= most_steps:
        raise SegarError(f"an experiment takes 1 to {most_steps} steps, and this one another number")
    level = numbers(request.get("level", 0), "level", (), 0, levels - 1)
    if (level != np.rint(level)).any():
        raise SegarError(f"'level' must be a whole number from 0 to {levels - 1}")
    changes, layout = [], lab.hidden.layout
    bounds = {factor.__name__: (factor, *ends) for factor, ends in lab.settable.items()}
    for entity, factors in request.get("set", {}).items():
        slot = layout.slot_index(entity)
        for name, given in factors.items():
            at = f"set.{entity}.{name}"
            if name not in bounds:
                raise SegarError(f"'{at}' cannot be set.{did_you_mean(name, bounds)}")
            factor, low, high = bounds[name]
            shape = () if factor.width == 1 else (factor.width,)
            changes.append((at, slot, factor, numbers(given, at, shape, low, high)))
    leading = [level.shape, actions.shape[:-2]]
    leading += [value.shape[: value.ndim - (f.width > 1)] for _, _, f, value in changes]
    try:
        batch = np.broadcast_shapes(*leading)
    except ValueError as error:
        raise SegarError(f"the numbers of experiments do not agree: {[list(one) for one in leading]}") from error
    n, is_batch = batch[0] if batch else 1, bool(batch)
    if not n:
        raise SegarError("a list of experiments is empty, and must hold one at least")
    level = np.broadcast_to(level, n).astype(int)
    values = lab.levels.values[level]
    for at, slot, factor, value in changes:
        if factor not in layout.columns or np.isnan(values[:, slot, layout.columns_of(factor)]).any():
            raise SegarError(f"'{at}': the entity has no {factor.__name__}")
        values[:, slot, layout.columns_of(factor)] = value.reshape(-1, factor.width)
    return level, values, np.broadcast_to(actions, (n, *actions.shape[-2:])).astype(np.float32), is_batch


def numbers(given: Any, at: str, shape: tuple[int, ...], low: Any, high: Any) -> np.ndarray:
    """Numbers of that shape (-1: any), or several of them with one more axis before; float64.

    Raises:
        SegarError: they are none, are not finite, or lie outside of their bounds.
    """
    try:
        found = np.asarray(given)
    except ValueError:  # lists of unlike lengths
        found = np.asarray(None)
    forms = [form for form in (shape, (-1, *shape)) if len(form) == found.ndim]
    fits = forms and all(want in (-1, have) for want, have in zip(forms[0], found.shape, strict=True))
    if found.dtype.kind not in "iuf" or not fits:
        wanted = (
            "a number" if not shape else f"{shape[-1]} numbers" if len(shape) == 1 else f"lists of {shape[-1]} numbers"
        )
        raise SegarError(f"'{at}' must be {wanted}, or a list of such for several experiments, not {shown(given)}")
    outside = ~((found >= low) & (found <= high))  # NaN is outside
    if outside.any():
        raise SegarError(f"'{at}' is {found[outside][0]:g}, and must be from {np.min(low):g} to {np.max(high):g}")
    return found.astype(float)


def _recorded(session: Session) -> list[dict[str, Any]]:
    """Recordings of random actions on the levels, for the whole budget."""
    lab, found = session.lab, list[dict[str, Any]]()
    rng = np.random.default_rng((lab.seed, lab.world))
    while session.left:
        steps = min(lab.most_steps, session.left)
        actions = rng.uniform(lab.task.action_low, lab.task.action_high, (steps, len(lab.task.action_low)))
        request = {"level": len(found) % START_LEVELS, "actions": actions.tolist()}
        states = lab.play(lab.hidden, *read_experiment(lab, request, START_LEVELS, steps)[:3]).seen[0, 0]
        found.append(request | {"observations": lab.observed(states, len(found))})
        session.left -= steps
    return found


def _json(data: Mapping[str, Any]) -> str:
    """One line of JSON; arrays are lists, and NaN in them null."""
    return json.dumps(data, default=_plain, allow_nan=False)


def _plain(array: Any) -> Any:
    """An array, or a number of numpy, as plain data."""
    found = np.asarray(array).astype(object)
    return np.where(found != found, None, found).tolist()  # type: ignore[call-overload]  # NaN is not itself
