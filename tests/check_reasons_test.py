#!/usr/bin/env python3
"""Tests of check_reasons.py: what it takes for a reason, and what it misses in the lists."""
import pathlib
import tempfile
import unittest

import check_reasons

OPENAPI = """    ProblemReason:
      anyOf:
        - enum: [{}]
        - type: string

    Next:
"""


class ReasonsTest(unittest.TestCase):
    def test_a_reason_follows_the_detail(self):
        source = '''
            return fail(ErrorCode::invalid, fmt::format("{}, ({})", "odd", name(1, 2)), "out_of_range");
            co_return http::problem(404, "there, is (none)", "unknown_path", {{"needs", "admin"}});
            return refuse(ErrorCode::unavailable, "wait", "throttled", wait);
            return not_authenticated("no", "wrong_token", R"(Bearer error="invalid_token")");
            return fail(ErrorCode::not_found, "without a reason");
            return fail(ErrorCode::invalid, error.what(), reason);
        '''
        found = [reason for _, reason in check_reasons.reasons_in(source)]
        self.assertEqual(found, ["out_of_range", "unknown_path", "throttled", "wrong_token"])

    def test_what_is_not_listed_and_what_nothing_gives_is_found(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "server/api").mkdir(parents=True)
            (root / "docs").mkdir()
            (root / "server/api/a.cpp").write_text('fail(ErrorCode::invalid, "x", "of_code");')
            listed = sorted(check_reasons.FOR_COMMANDS)
            rows = "".join(f"| `{reason}` | 409 | x |\n" for reason in listed)
            (root / "server/api/openapi.yaml").write_text(OPENAPI.format(", ".join([*listed, "of_code"])))
            (root / "docs/api.md").write_text(f"### Reasons\n{rows}| `of_code`, `of_nothing` | 422 | x |\n## Next\n")
            self.assertEqual(list(check_reasons.problems(root)), ["docs/api.md:1: no answer has the listed reason of_nothing"])
            (root / "docs/api.md").write_text(f"### Reasons\n{rows}## Next\n| `of_code` | 422 | x |\n")
            self.assertEqual(list(check_reasons.problems(root)),
                             ["server/api/a.cpp:1: the reason of_code is not listed in docs/api.md"])

    def test_the_project_lists_all(self):
        root = pathlib.Path(__file__).parent.parent
        self.assertEqual(list(check_reasons.problems(root)), [])
        self.assertGreater(len(check_reasons.answered(root)), 100)


if __name__ == "__main__":
    unittest.main()
