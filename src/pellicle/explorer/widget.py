"""Widget of the explorer for notebooks: the page's script, with messages to the kernel."""

from collections.abc import Mapping
from functools import cache
from threading import Thread
from typing import Any

from pellicle.errors import needs
from pellicle.explorer.page import style, widget_module
from pellicle.explorer.session import Session

_LONG = frozenset({"fit"})
"""Requests that are answered in a thread: the kernel answers others, and runs cells, meanwhile."""


def widget(session: Session) -> Any:
    """Return an anywidget that shows a session.

    **Raises:** UsageError without anywidget.
    """
    with needs("explore", "the explorer in notebooks needs"):
        import anywidget  # noqa: F401
    return _widget_class()(session)


def _answered(session: Session, request: str, body: Mapping[str, Any]) -> dict[str, Any]:
    """Answer of a session. Raises ValueError where it is an error."""
    answer = session.answer(request, body)
    if "error" in answer:
        raise ValueError(answer["error"])
    return answer


def _defaults(session: Session, angles: list[float]) -> dict[str, float]:
    """The scene's own values of the sliders at these angles. Raises ValueError for wrong ones."""
    controls = _answered(session, "scene", {"angles": angles or None})["controls"]
    return {control["name"]: control["value"] for control in controls}


@cache
def _widget_class() -> Any:
    import anywidget
    import traitlets

    class Explorer(anywidget.AnyWidget):
        """Sliders of a film beside its spectrum, colour and plan, in a cell of a notebook.

        `values` are the sliders' numbers by name, in their units; setting it moves the sliders. `angles` are
        angles of incidence in degrees, with a curve for each; empty for those of the scene.
        """

        _esm = widget_module()
        _css = style()
        values = traitlets.Dict().tag(sync=True)
        angles = traitlets.List(traitlets.Float()).tag(sync=True)

        def __init__(self, session: Session) -> None:
            self._session = session
            super().__init__(values=_defaults(session, []))
            self.on_msg(self._receive)

        @traitlets.validate("angles")
        def _with_sliders(self, proposal: Any) -> list[float]:
            """Keep the values of the sliders that there are at these angles."""
            defaults = _defaults(self._session, proposal["value"])
            self.values = {name: self.values.get(name, value) for name, value in defaults.items()}
            return proposal["value"]

        def recipe(self) -> str:
            """Return the film with the current values as a recipe in TOML.

            **Raises:** ValueError for a film that no recipe expresses.
            """
            body = {"values": self.values, "angles": self.angles or None}
            return _answered(self._session, "recipe", body)["toml"]

        def _receive(self, _: Any, message: Any, buffers: Any) -> None:
            """Answer a message `{id, request, body}` by `{id, answer}`."""
            if not isinstance(message, Mapping) or not {"id", "request"} <= message.keys():
                return
            if message["request"] in _LONG:
                Thread(target=self._answer, args=(message,), daemon=True).start()
            else:
                self._answer(message)

        def _answer(self, message: Mapping[str, Any]) -> None:
            answer = self._session.answer(message["request"], message.get("body", {}))
            self.send({"id": message["id"], "answer": answer})

    return Explorer
