# SPDX-License-Identifier: Apache-2.0
"""The documentation's scripts: broken links and anchors are found with file and line, pages get mkdocs' dialect, and
the site's checker sees dead links and requests to other machines."""
import pathlib
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "deploy/scripts"))

import doc_pages  # noqa: E402: the path is known only now
import docs_site  # noqa: E402
import metrics_list  # noqa: E402


def faults_of(**texts):
    pages = {f"docs/{name}.md": doc_pages.Page(f"docs/{name}.md", text) for name, text in texts.items()}
    return list(doc_pages.broken_links(pages, [*pages, "docs/images/a.png", "README.txt"]))


class Links(unittest.TestCase):
    def test_sound_ones_pass(self):
        other = "# Título: a `b_c` d\n## Twice\n## Twice\n"
        page = ("# Top\n[x](other.md#título-a-b_c-d) [y](#top) [z](other.md#twice-1)\n![p](images/a.png) [up](../README.txt)"
                " [dir](images) [site](https://example.org)\n[r]: other.md\n[text][r]\n`[code](gone.md)`\n"
                "```\n[block](gone.md)\n```\n")
        self.assertEqual(faults_of(page=page, other=other), [])

    def test_broken_ones_have_file_line_and_reason(self):
        page = "# Top\n\n[a](gone.md)\n![b](images/gone.png) and\n[c](#nowhere) [d](other.md#nowhere)\n[e][none]\n"
        self.assertEqual(faults_of(page=page, other="# Other\n"), [
            "docs/page.md:3: gone.md does not exist",
            "docs/page.md:4: images/gone.png does not exist",
            "docs/page.md:5: docs/page.md has no heading #nowhere",
            "docs/page.md:5: docs/other.md has no heading #nowhere",
            "docs/page.md:6: [none] has no definition"])

    def test_links_over_two_lines_and_images_in_links_are_seen(self):
        page = "# Top\n[two\nlines](gone.md) [![i](images/gone.png)](other.md)\n"
        self.assertEqual(faults_of(page=page, other="# Other\n"), [
            "docs/page.md:3: gone.md does not exist", "docs/page.md:3: images/gone.png does not exist"])

    def test_nothing_outside_the_repository(self):
        self.assertEqual(faults_of(page="# Top\n[a](../../x.md)\n"),
                         ["docs/page.md:2: ../../x.md leaves the repository"])


class Dialect(unittest.TestCase):
    def test_headings_have_the_anchors_of_github(self):
        self.assertEqual(docs_site.for_mkdocs("# A `b_c`, d\n# A b_c d\n"),
                         "# A `b_c`, d {#a-b_c-d}\n\n# A b_c d {#a-b_c-d-1}\n")

    def test_lists_are_set_off_and_nested_by_four_spaces(self):
        self.assertEqual(docs_site.for_mkdocs("Text:\n- one\n  goes on\n  - inner\n\n    ```\n    code\n    ```\n- two\n"),
                         "Text:\n\n- one\n    goes on\n    - inner\n\n        ```\n        code\n        ```\n\n- two\n")

    def test_tables_are_set_off(self):
        self.assertEqual(docs_site.for_mkdocs("Text\n| a |\n|---|\n| 1 |\n"), "Text\n\n| a |\n|---|\n| 1 |\n")

    def test_indented_code_stays(self):
        text = "Text:\n\n    a = b\n        + c\n"
        self.assertEqual(docs_site.for_mkdocs(text), text)


class Site(unittest.TestCase):
    def test_dead_links_and_requests_are_found(self):
        with tempfile.TemporaryDirectory() as folder:
            site = pathlib.Path(folder)
            (site / "a.html").write_text('<a href="b.html#there">x</a>\n<a href="b.html#gone">y</a>\n'
                                         '<script src="https://cdn.example.org/x.js"></script>\n<img src="gone.png">\n'
                                         '<a href="https://example.org">z</a>\n', encoding="utf-8")
            (site / "b.html").write_text('<h1 id="there">b</h1>', encoding="utf-8")
            (site / "c.css").write_text("a { background: url(//example.org/a.png) }", encoding="utf-8")
            self.assertEqual(list(docs_site.site_faults(site.resolve())), [
                "a.html:2: b.html#gone: no such anchor",
                "a.html:3: loads https://cdn.example.org/x.js from elsewhere",
                "a.html:4: gone.png does not exist",
                "c.css: loads //example.org/a.png from elsewhere"])


class Metrics(unittest.TestCase):
    def test_sources_name_counters_and_families(self):
        found = {metric.name: metric for metric in metrics_list.metrics()}
        self.assertEqual(found["emitd_frames_late_total"].help, "frames flagged late")
        self.assertEqual(found["emitd_stage_seconds"].samples(),
                         {"emitd_stage_seconds_bucket", "emitd_stage_seconds_sum", "emitd_stage_seconds_count"})
        self.assertEqual(found["emitd_client_delay_seconds"].type, "gauge")


if __name__ == "__main__":
    unittest.main()
