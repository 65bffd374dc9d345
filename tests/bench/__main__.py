"""`python -m tests.bench`: measure everything and print the table."""

import sys
from pathlib import Path

import pytest

if __name__ == "__main__":
    sys.exit(pytest.main([str(Path(__file__).parent), "-m", "bench", "--quiet", "--no-header", *sys.argv[1:]]))
