"""Debian's chromium under Selenium, for the pages that people look at."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.by import By

from tests.support.served import PATIENCE_S

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
needs_browser = pytest.mark.skipif(
    CHROMIUM is None or DRIVER is None, reason="no browser: apt-get install chromium chromium-driver"
)
DESKTOP, PHONE = (1280, 800), (390, 844)


class Page:
    """A page in a window of its own."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self.driver = driver

    def resize(self, size: tuple[int, int]) -> None:
        """To a window of this size; a small one is a phone's."""
        width, height = size
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 900}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)

    def open(self, address: str) -> None:
        self.driver.get(address)

    @property
    def text(self) -> str:
        """All that can be read."""
        return str(self.run("return document.body.innerText"))

    def run(self, script: str, *values: object) -> Any:
        return self.driver.execute_script(script, *values)

    def until(self, holds: Callable[[], object], limit_s: float = PATIENCE_S) -> None:
        end_s = time.monotonic() + limit_s
        while not holds():
            if time.monotonic() > end_s:
                pytest.fail(f"never came; the page says:\n{self.text}\n{self.faults}")
            time.sleep(0.1)

    def shows(self, *texts: str) -> None:
        """Wait until each of the texts is on the page."""
        self.until(lambda: all(text in self.text for text in texts))

    def press(self, name: str) -> None:
        """The button with this text or label."""
        script = (
            "const all = [...document.querySelectorAll('button, [role=tab]')];"
            "const one = all.find(b => b.offsetParent && (b.innerText.trim() === arguments[0] ||"
            " b.getAttribute('aria-label') === arguments[0])); if (one) one.click(); return !!one"
        )
        self.until(lambda: self.run(script, name), 20.0)

    def click(self, selector: str) -> None:
        """The middle of the first element that this finds, with the mouse."""
        element = self.driver.find_element(By.CSS_SELECTOR, selector)
        ActionChains(self.driver).move_to_element(element).click().perform()

    def click_at(self, selector: str, x: int, y: int) -> None:
        """So far right of and below the first element's left upper corner, with the mouse."""
        element = self.driver.find_element(By.CSS_SELECTOR, selector)
        left, top = x - element.size["width"] // 2, y - element.size["height"] // 2
        ActionChains(self.driver).move_to_element_with_offset(element, left, top).click().perform()

    def drag(self, selector: str, right: int, down: int) -> None:
        """From the middle of the first element so far, with the mouse."""
        element = self.driver.find_element(By.CSS_SELECTOR, selector)
        chain = ActionChains(self.driver, duration=50).move_to_element(element).click_and_hold()
        chain.move_by_offset(right, down).release().perform()

    def turn_wheel(self, selector: str, down: int) -> None:
        """So far over the middle of the first element, with the mouse."""
        origin = ScrollOrigin.from_element(self.driver.find_element(By.CSS_SELECTOR, selector))
        ActionChains(self.driver).scroll_from_origin(origin, 0, down).perform()

    def spread(self, selector: str, before: int, after: int) -> None:
        """Two fingers beside the middle of the first element, each so far from it before and after."""
        box = self.driver.find_element(By.CSS_SELECTOR, selector).rect
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        for kind, off in (("touchStart", before), ("touchMove", (before + after) // 2), ("touchMove", after)):
            self._touch(kind, [{"x": x - off, "y": y, "id": 0}, {"x": x + off, "y": y, "id": 1}])
        self._touch("touchEnd", [])

    def _touch(self, kind: str, points: list[dict[str, float]]) -> None:
        self.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    def darken(self) -> None:
        """As on a system that is set to dark."""
        dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)

    @property
    def faults(self) -> list[str]:
        """What the console says of errors."""
        return [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] == "SEVERE"]


@contextmanager
def page(size: tuple[int, int] = DESKTOP) -> Iterator[Page]:
    options = Options()
    options.binary_location = str(CHROMIUM)
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    with TemporaryDirectory(ignore_cleanup_errors=True) as folder:  # the browser leaves files behind
        service = Service(str(DRIVER), env={**os.environ, "TMPDIR": folder})
        driver = webdriver.Chrome(options=options, service=service)
        try:
            shown = Page(driver)
            shown.resize(size)
            yield shown
        finally:
            driver.quit()
