"""`ephs view`: a mechanism in the browser, with sliders for its joints."""

from typing import Annotated

from cyclopts import Parameter

from ephs.cli.input import AS_GIVEN, TEXTS, BadInput, LoadOptions, addressed, load_model, say


def view(
    scene: str,
    /,
    *,
    port: int = 0,
    browser: Annotated[bool, Parameter(negative="--no-browser")] = True,
    loading: LoadOptions = AS_GIVEN,
) -> int:
    """Show a mechanism in the browser with a slider for each joint; other models can be dropped on the page.

    Parameters
    ----------
    scene
        Scene file (.toml), model (.urdf, .xml, .sdf), or FILE.py:NAME.
    port
        Port of this machine to serve the page at. Default: any free port.
    browser
        Open the page in the browser.
    """
    import ephs

    def loaded(file: str) -> ephs.Scene:
        model = load_model(file, loading)
        if not isinstance(model, ephs.Scene):
            raise BadInput(TEXTS["no-scene"].format(found=file))
        return model

    model = loaded(scene)
    with addressed(scene):
        from ephs.show.motions.viewer import Posed, served

        server = served(Posed(model, lambda file: loaded(str(file))), port=port)
    address = f"http://127.0.0.1:{server.server_address[1]}/"
    say(f"{address} (stop with Ctrl+C)")
    if browser:
        import webbrowser

        webbrowser.open(address)
    try:
        server.serve_forever()
    except KeyboardInterrupt:
        return 0
    finally:
        server.server_close()
    return 0
