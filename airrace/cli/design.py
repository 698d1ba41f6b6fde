"""The command `airrace design`: lay out a course in the browser."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answering
from airrace.cli.options import AircraftFile, Verbose


def design(
    track: Annotated[Path, typer.Argument(metavar="TRACK.yaml", readable=False, help="The track file to be edited.")],
    aircraft: AircraftFile = None,
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="Port; by default a free one.")] = 0,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only print the address.")] = False,
    verbose: Verbose = False,
) -> None:
    """Lay out a course in the browser: drag gates and see the race time change (extra: design).

    The page is served to this machine alone, under an address with a token, until Ctrl-C. Saving edits the file in
    place; what is not saved by then lies beside it.
    """
    with answering(as_json=False, verbose=verbose) as answer:
        from airrace.design.designer import Designer

        try:
            from airrace.design.server import DesignServer
        except ModuleNotFoundError as error:
            from airrace.errors import UsageError

            raise UsageError(f"the designer needs {error.name}: pip install 'airrace[design]'") from error
        from airrace import interrupts

        designer = Designer(track, None if aircraft is None else str(aircraft))
        try:
            server = DesignServer(designer, port)
            print(f"{server.address}\nCtrl-C ends it.", flush=True)
            server.run(browser=not no_browser)
        except KeyboardInterrupt:
            interrupts.hear()  # the way in which it ends
        finally:
            unsaved = designer.close()
        if unsaved is not None:
            answer.texts.append(f"what was not saved lies in {unsaved}")
