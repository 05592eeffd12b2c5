"""A comparison as JUnit XML: one test case a pair, a test suite a label.

Regressed is a failure of its kind, inconclusive is skipped with its reason; what was wrong or crashed before, too, is
in `system-out` of a case that passes. A label whose times were compared has one more case, `time of all pairs`.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree

import pandas as pd

from cpbench.analysis.comparison import Comparison, PairVerdict
from cpbench.analysis.comparison.gates import WORST
from cpbench.analysis.comparison.suites import Suite
from cpbench.foundation.text import counted
from cpbench.report.comparison import words
from cpbench.report.text import one_line


def document(comparison: Comparison) -> str:
    """Write the whole file."""
    root = ElementTree.Element("testsuites", name="cpbench compare")
    rows = {str(label): own for label, own in comparison.pairs.groupby("label_new", sort=True)}
    for suite in comparison.suites:
        root.append(_suite(comparison, suite, rows[suite.label]))
    for name in ("tests", "failures", "errors"):
        root.set(name, str(sum(int(child.get(name, "0")) for child in root)))
    root.set("time", f"{sum(float(child.get('time', '0')) for child in root):.6f}")
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _suite(comparison: Comparison, suite: Suite, own: pd.DataFrame) -> ElementTree.Element:
    name = one_line(suite.label)
    element = ElementTree.Element("testsuite", name=name)
    for names, (_, pair) in zip(_names(own), own.iterrows(), strict=True):
        element.append(_case(comparison, name, names, pair))
    if suite.time is not None:
        element.append(_whole(suite, name))
    element.set("tests", str(len(element)))
    element.set("failures", str(len(element.findall("testcase/failure"))))
    element.set("errors", "0")
    element.set("skipped", str(len(element.findall("testcase/skipped"))))
    element.set("time", f"{sum(float(case.get('time', '0')) for case in element):.6f}")
    return element


def _names(own: pd.DataFrame) -> list[str]:
    """Name the problems, with what tells pairs of one problem apart where there are several."""
    names = own["problem"].astype(str)
    for column in ("tolerance", "start", "set", "label_base", "step", "options", "fingerprint"):
        twice = names.duplicated(keep=False)
        if not twice.any():
            break
        if own.loc[twice, column].nunique() > 1:
            names = names.where(~twice, names + f" {column}=" + own[column].astype(str))
    return [one_line(name) for name in names]


def _case(comparison: Comparison, suite: str, name: str, pair: pd.Series) -> ElementTree.Element:
    seconds = float(pair["time_new"])
    time = f"{seconds if math.isfinite(seconds) else 0.0:.6f}"
    case = ElementTree.Element("testcase", name=name, classname=suite, time=time)
    why = one_line(pair["why"])
    if pair["verdict"] == PairVerdict.REGRESSED:
        failure = ElementTree.SubElement(case, "failure", message=why, type=one_line(pair["kind"]))
        failure.text = words.again(comparison, pair)
    elif pair["verdict"] == PairVerdict.INCONCLUSIVE:
        ElementTree.SubElement(case, "skipped", message=f"inconclusive: {why}")
    elif pair["verdict"] == PairVerdict.IMPROVED:
        ElementTree.SubElement(case, "system-out").text = f"improved: {why}"
    elif pair["status_new"] in WORST:
        before = f"{pair['status_new']}, as before: {one_line(pair['message_new'])}".removesuffix(": ")
        ElementTree.SubElement(case, "system-out").text = before
    return case


def _whole(suite: Suite, name: str) -> ElementTree.Element:
    case = ElementTree.Element("testcase", name="time of all pairs", classname=name, time="0.000000")
    ratio_text = f"{words.times_of(suite)} times the time, {counted(suite.timed, 'pair')}"
    if suite.time == PairVerdict.REGRESSED:
        ElementTree.SubElement(case, "failure", message=ratio_text, type="time")
    elif suite.time == PairVerdict.INCONCLUSIVE:
        ElementTree.SubElement(case, "skipped", message=f"inconclusive: {ratio_text}; {suite.why}")
    else:
        ElementTree.SubElement(case, "system-out").text = f"{suite.time}: {ratio_text}"
    return case
