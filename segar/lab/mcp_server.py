"""A session as a server of the Model Context Protocol: three tools over standard input and output. Needs the package mcp."""

import json
from typing import Any

from mcp.server import MCPServer

from segar.lab.session import Session

Data = dict[str, Any] | None
Actions = list[list[float]] | None


def make_server(session: Session) -> MCPServer:
    """The server of a session; ``run("stdio")`` serves, and listens on no port."""
    language = session.reply(b'{"do": "language"}')
    server = MCPServer("segar-lab", instructions=language, log_level="ERROR")

    def do(kind: str, **request: Any) -> str:
        given = {name: value for name, value in request.items() if value is not None}
        return session.reply(json.dumps({"do": kind, **given}).encode())

    @server.tool()
    def experiment(level: int = 0, set: Data = None, actions: Actions = None, steps: int | None = None) -> str:
        """What is seen of an experiment in the hidden world. It costs its steps.

        level: in which it begins. set: entity to factor to its value at the beginning. actions: one for each step; or
        steps: that pass without an action.
        """
        return do("experiment", level=level, set=set, actions=actions, steps=steps)

    @server.tool()
    def predict(
        law: Data = None, level: int = 0, set: Data = None, actions: Actions = None, steps: int | None = None
    ) -> str:
        """What would be seen of an experiment if a law held, {"options": {name: {constant: value}}}. It costs nothing."""
        return do("predict", law=law, level=level, set=set, actions=actions, steps=steps)

    @server.tool()
    def answer(law: Data = None, answers: Data = None) -> str:
        """The grade of a law, which ends the experiments; or marks of answers to questions; without either, the questions."""
        return do("answer", law=law, answers=answers)

    return server
