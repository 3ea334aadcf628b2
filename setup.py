"""Packs aircraft/ and scenarios/, which lie beside the package in a checkout, into it for a wheel."""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWithData(build_py):
    """Copies the data folders to landing_sim/data/ in the build."""

    def run(self) -> None:
        super().run()
        if not self.editable_mode:
            for name in ("aircraft", "scenarios"):
                target = Path(self.build_lib) / "landing_sim" / "data" / name
                shutil.rmtree(target, ignore_errors=True)
                shutil.copytree(Path(__file__).parent / name, target)


setup(cmdclass={"build_py": BuildWithData})
