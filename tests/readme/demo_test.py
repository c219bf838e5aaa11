"""The progress of tools/demo: a line for the files that are built, and none for what Ninja does before them.

usage: demo_test.py SOURCE_FOLDER
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

SOURCE = pathlib.Path(sys.argv.pop(1)).resolve()

CHECK = ["0 of 2 Re-checking globbed directories..."]
CONFIGURE = ["1 of 2 Re-running CMake...", "-- Configuring done", "-- Generating done"]
IMUD = "#!/bin/sh\necho \"imud $*\"\n"


def build(files: int) -> list[str]:
    return [f"{i} of {files} Building CXX object core/{i}.cpp.o" for i in range(1, files + 1)]


class Demo(unittest.TestCase):
    def shown(self, lines: list[str]) -> list[str]:
        """Returns the progress that tools/demo shows, in a tree of stand-ins, for this output of the build."""
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            log = root / "log"
            log.write_text("".join(line + "\n" for line in lines))

            def program(path: str, text: str) -> None:
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text)
                (root / path).chmod(0o755)

            program("tools/setup", "#!/bin/sh\n")
            program("bin/cmake", f'#!/bin/sh\n[ "$1" = --preset ] || cat {log}\n')
            program("build/release/imud", IMUD)
            shutil.copy(SOURCE / "tools/demo", root / "tools/demo")
            result = subprocess.run([root / "tools/demo"], capture_output=True, text=True, check=True,
                                    env=os.environ | {"PATH": f"{root / 'bin'}:{os.environ['PATH']}"})
            self.assertEqual(result.stderr, "")
            before, demo, after = result.stdout.partition("imud demo\n")
            self.assertTrue(demo)
            self.assertTrue(after.splitlines()[-1].startswith("built: "), after)
            shown, others = ([line.strip() for line in text.splitlines() if line.endswith(" files")]
                             for text in (before, after))
            self.assertEqual(shown, others)
            return shown

    def test_a_first_build_shows_each_twentieth(self):
        shown = self.shown(CHECK + build(400))
        self.assertEqual(shown[:2] + shown[-1:], ["1 of 400 files", "20 of 400 files", "400 of 400 files"])
        self.assertEqual(len(shown), 21)

    def test_another_configuration_is_no_file(self):
        self.assertEqual(self.shown(CHECK + CONFIGURE + CHECK + build(400)), self.shown(build(400)))

    def test_nothing_to_build_shows_nothing(self):
        self.assertEqual(self.shown(CHECK + ["ninja: no work to do."]), [])


if __name__ == "__main__":
    unittest.main()
