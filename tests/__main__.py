"""`make test`: find a browser (on Debian as root, install one), then run every test."""

import os
import shutil
import subprocess
import sys

import pytest

from app.export import chromium


def browser() -> str | None:
    """The Chromium for the browser tests; on Debian as root it is installed when missing."""
    try:
        return chromium.find()
    except chromium.NoChromium as error:
        if shutil.which("apt-get") is None or os.geteuid() != 0:
            print(f"tests: {error}", file=sys.stderr)
            return None
    print("tests: installing Chromium with apt-get ...", flush=True)
    quiet = {"stdout": subprocess.DEVNULL, "env": {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}}
    subprocess.run(["apt-get", "update"], check=False, **quiet)  # type: ignore[call-overload]
    done = subprocess.run(["apt-get", "install", "--yes", "--no-install-recommends", "chromium", "fonts-dejavu-core"],
                          check=False, **quiet)  # type: ignore[call-overload]
    if done.returncode != 0:
        print("tests: `apt-get install chromium` failed; run it by hand and see why", file=sys.stderr)
        return None
    return chromium.find()


class Failures:
    """A pytest plugin that remembers which tests failed."""

    def __init__(self) -> None:
        self.ids: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.ids.add(report.nodeid)


def main() -> int:
    found = browser()
    if found is None:
        return 1
    os.environ["PAIKKA_CHROMIUM"] = found
    if sys.argv[1:]:
        return int(pytest.main(sys.argv[1:]))
    failures = Failures()
    workers = str(min(os.cpu_count() or 1, 4))
    code = int(pytest.main(["--quiet", "--durations=15", "-n", workers, "--dist", "loadfile"], plugins=[failures]))
    if code == 1 and all(name.startswith("tests/browser/") for name in failures.ids):
        # drawing by software takes long on a busy machine; a real fault fails again
        print("tests: the browser tests that failed run once more", flush=True)
        code = int(pytest.main(["--quiet", *sorted(failures.ids)]))
    return code


if __name__ == "__main__":
    sys.exit(main())
