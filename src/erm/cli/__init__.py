"""Command line of ``erm``: from MPCs to a map, from a map to its score and to the MPCs that it predicts."""

import typer

from erm.cli.evaluate import evaluate
from erm.cli.examples import EXAMPLES
from erm.cli.export import export
from erm.cli.letter import letter
from erm.cli.predict import predict
from erm.cli.reconstruct import reconstruct
from erm.common import console

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # markup would swallow units in brackets
    help="Reconstruct the environment from multipath components (MPCs), evaluate it, and predict from it.",
)
for command in (reconstruct, predict, letter, evaluate, export):
    app.command()(command)
console.add_options(app, EXAMPLES)


def main() -> None:
    """Run the command line."""
    console.run(app)
