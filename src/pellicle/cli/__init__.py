"""The `pellicle` command: results on stdout, messages on stderr."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from typing import Annotated

from cyclopts import App, Parameter

from pellicle.cli.chart import chart
from pellicle.cli.compare import compare
from pellicle.cli.cost import cost
from pellicle.cli.demo import demo
from pellicle.cli.fit import fit
from pellicle.cli.materials import materials
from pellicle.cli.plan import plan
from pellicle.cli.sample import sample
from pellicle.cli.session import say
from pellicle.cli.simulate import simulate
from pellicle.cli.verbose import log_to_stderr
from pellicle.errors import DataError, UsageError

INTERRUPTED = 130

app = App(
    name="pellicle",
    help="Thickness and refractive index of thin layers from measured spectra and BRDF samples.",
    help_format="plaintext",
    version_flags=["--version"],
    exit_on_error=False,
    print_error=True,
    result_action="return_value",
)
app.command(fit)
app.command(sample)
app.command(simulate)
app.command(plan)
app.command(compare)
app.command(cost)
app.command(chart)
app.command(materials)
app.command(demo)
app.register_install_completion_command(help="Install completion of commands and flags for this shell.")

command = app.meta
"""A command of `app` with the flags that all commands share."""


@command.default
def _any(
    *words: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)],
    verbose: Annotated[
        bool,
        Parameter(negative="", help="Log each step to stderr."),
    ] = False,
) -> int:
    with log_to_stderr() if verbose else nullcontext():
        return int(app(words) or 0)


def main() -> int:
    """Run the command line and return its exit code.

    0 good, 2 wrong usage, 3 bad data, 4 no clear answer, 5 a chain that is too short, 130 interrupted.
    """
    from cyclopts import CycloptsError

    try:
        return int(command(sys.argv[1:]) or 0)
    except CycloptsError:
        return 2  # cyclopts has printed the error
    except UsageError as error:
        say(f"pellicle: {error}")
        return 2
    except (DataError, ValueError) as error:
        say(f"pellicle: {error}")
        return 3
    except KeyboardInterrupt:
        say("pellicle: interrupted")
        return INTERRUPTED
    except BrokenPipeError:
        return 0
