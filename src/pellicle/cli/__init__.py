"""The `pellicle` command: results on stdout, messages on stderr."""

import gc
import os
import sys
from contextlib import nullcontext, suppress
from typing import Annotated, NoReturn

from cyclopts import App, Parameter

from pellicle.cli.chart import chart
from pellicle.cli.console import print_every_sign
from pellicle.cli.cost import cost, plan
from pellicle.cli.doctor import doctor
from pellicle.cli.explore import explore
from pellicle.cli.export import export
from pellicle.cli.fit import compare, fit, sample
from pellicle.cli.identify import identify
from pellicle.cli.map import map
from pellicle.cli.messages import abandon_stdout, as_flags, log_to_stderr, say, show
from pellicle.cli.plan_measurement import plan_measurement
from pellicle.cli.read import materials, read
from pellicle.cli.series import series
from pellicle.cli.session import BAD_DATA, INTERRUPTED, WRONG_USAGE, interruptible
from pellicle.cli.simulate import demo, simulate
from pellicle.cli.warm import warm
from pellicle.cli.watch import watch
from pellicle.errors import UsageError

app = App(
    name="pellicle",
    help="Thickness and refractive index of thin layers from measured spectra and BRDF samples.",
    help_format="plaintext",
    version_flags=["--version"],
    exit_on_error=False,
    print_error=True,
    result_action="return_value",
)
COMMANDS = (
    fit,
    sample,
    identify,
    read,
    simulate,
    plan,
    plan_measurement,
    compare,
    cost,
    chart,
    export,
    explore,
    map,
    series,
    watch,
    materials,
    demo,
    warm,
    doctor,
)
for function in COMMANDS:
    app.command(function)
app.register_install_completion_command(help="Install completion of commands and flags for this shell.")

command = app.meta
"""A command of `app` with the flags that all commands share."""


@command.default
def _any(
    *words: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)],
    verbose: Annotated[bool, Parameter(negative="", help="Log each step to stderr.")] = False,
) -> int:
    with log_to_stderr() if verbose else nullcontext():
        return int(app(words) or 0)


def process() -> NoReturn:
    """Run the command line as this process.

    After Ctrl-C the process ends without Python's clean-up, in which XLA often crashes where it was
    compiling: 6 of 14 times, with jaxlib 0.10. NumPy multiplies small matrices here, for which threads only
    wait for each other: on two busy cores they took three times as long. The user's own number is kept.
    Imports make a million objects that stay: the garbage collector looks at them less often.
    """
    gc.freeze()
    gc.set_threshold(50_000, 5, 10)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    code = main()
    if code == INTERRUPTED:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        os._exit(code)
    sys.exit(code)


def main() -> int:
    """Run the command line and return its exit code.

    0 good, 2 wrong usage, 3 bad data or a disk that is full, 4 no clear answer, 5 a chain that is too short,
    6 a limit of --spec that is not met, 130 interrupted. With --json an error is printed on stdout too, as a
    JSON object.
    """
    print_every_sign()
    with interruptible():
        code, error = _outcome(sys.argv[1:])
    if error and "--json" in sys.argv:
        from pellicle.reporting.json_record import error_record

        with suppress(OSError):
            show(error_record(error, code))
    return code


def _outcome(words: list[str]) -> tuple[int, str]:
    """Run a command: its exit code, and what is wrong with its arguments or recipe."""
    from cyclopts import CycloptsError

    try:
        if sum(word.partition("=")[0] == "--layer" for word in words) > 1:
            raise UsageError(
                "--layer is given twice, and flags describe one layer: write a [[scene.layer]] for each into"
                " a recipe, from the top down, and give it by --recipe"
            )
        return int(command(words) or 0), ""
    except CycloptsError as error:
        return WRONG_USAGE, str(error)  # cyclopts has printed the error
    except BrokenPipeError:
        abandon_stdout()
        return 0, ""
    except KeyboardInterrupt:
        say("pellicle: interrupted")
        return INTERRUPTED, ""
    except (ValueError, OSError) as error:
        message = as_flags(str(error))
        if isinstance(error, OSError) and error.filename is None and error.errno is not None:  # of a stream
            abandon_stdout()
            message = f"the result cannot be printed ({error.strerror})"
        say(f"pellicle: {message}")
        return (WRONG_USAGE if isinstance(error, UsageError) else BAD_DATA), message
