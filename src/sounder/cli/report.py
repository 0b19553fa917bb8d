"""``sounder report``: the page of products."""

from pathlib import Path
from typing import Annotated

import typer

from erm.common import console
from erm.common.outputs import protect_inputs, require_suffix


def report(
    products: Annotated[list[Path], typer.Argument(readable=False, help="Products of `sounder process`.")],
    out: Annotated[Path, typer.Option(help="The page: .html, one file that needs no network.")],
    title: Annotated[str, typer.Option(help="Title of the page.")] = "Campaign",
) -> None:
    """Make an HTML page from products: map, spectra, parameters.

    The page of a campaign file, with its options, is made by `sounder run`.
    """
    require_suffix(out, ".html")
    protect_inputs((out,), products)
    from sounder.report.of_products import contents_of_products
    from sounder.report.page import write_page

    contents = contents_of_products(products, title)
    print(f"{write_page(contents, out)}: {console.counted(len(contents.products), 'position')}")
    console.report_failures(list(contents.failures))
