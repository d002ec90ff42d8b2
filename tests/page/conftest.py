"""Fixtures for tests of pages in a browser. During a visit, only the page itself may be requested."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import toolchain
from built import built
from playwright.sync_api import Browser, Page, sync_playwright
from visiting import page_of

SIZE = {"width": 1000, "height": 900}


@pytest.fixture(scope="session")
def address(fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    return page_of(fmu, tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="session")
def controller_address(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The address of the controller's page."""
    return page_of(built("prw_controller.fmu"), tmp_path_factory.mktemp("controllers"))


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    toolchain.need("chromium")
    with sync_playwright() as playwright:
        path = shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def visit(browser: Browser, address: str) -> Iterator[Any]:
    """Returns a function that opens the page in a new context. The test fails if the page requests anything else or a script fails."""
    requested: list[str] = []
    contexts = []
    expected: set[str] = set()

    def visit(fragment: str = "", script: str = "", at: str = address, **settings: Any) -> Page:
        contexts.append(browser.new_context(**{"viewport": SIZE, **settings}))
        page = contexts[-1].new_page()
        page.route("**/*", lambda route: route.continue_())
        page.on("request", lambda request: requested.append(request.url))
        page.on("pageerror", lambda error: requested.append(f"error: {error}"))
        # In the console, the browser reports violations of the page's content security policy.
        page.on("console", lambda message: requested.append(message.text) if message.type == "error" else None)
        if script:
            page.add_init_script(script)
        page.goto(at + fragment)
        expected.update((at, at.replace("index.html", "manual.html")))
        return page

    yield visit
    for context in contexts:
        context.close()
    assert {url.split("#")[0] for url in requested if not url.startswith("blob:")} <= expected
