#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""What link_table makes of streams of which some or all is lost, without a link."""
import importlib.machinery
import importlib.util
import os
import sys
import types
import unittest

sys.dont_write_bytecode = True
NAME = os.path.join(os.path.dirname(os.path.abspath(__file__)), "link_table")
loader = importlib.machinery.SourceFileLoader("link_table", NAME)
link_table = importlib.util.module_from_spec(importlib.util.spec_from_loader("link_table", loader))
loader.exec_module(link_table)

CLOUDS = 80


def broken(row, topic, arrived, written=CLOUDS):
    """What is said to be broken when so many of the messages arrive."""
    writer = types.SimpleNamespace(written={topic: {number: (float(number), 0.0) for number in range(written)}})
    reader = types.SimpleNamespace(heard={topic: {number: (float(number), 0.01) for number in range(arrived)}} if arrived else {})
    cell = link_table.Cell()
    link_table.judge_stream(cell, row, topic, writer, reader, 0.0, float(CLOUDS))
    return cell.broken


def row_of(name):
    (row,) = (row for row in link_table.ROWS if name in row.name)
    return row


class LinkTable(unittest.TestCase):
    def test_at_5_percent_loss_nine_tenths_must_arrive(self):
        row = row_of("5 % loss")
        for topic in ("points", "imu", "lio", "gps"):
            self.assertEqual(broken(row, topic, CLOUDS), [])
            self.assertEqual(broken(row, topic, 72), [])
            for arrived in (0, 71):
                self.assertEqual(broken(row, topic, arrived), [f"{topic} lost"], arrived)

    def test_elsewhere_all_must_arrive(self):
        for row in link_table.ROWS:
            if "5 % loss" not in row.name and not row.down_s:
                self.assertEqual(broken(row, "points", CLOUDS), [])
                self.assertEqual(broken(row, "points", CLOUDS - 1), ["points lost"], row.name)

    def test_nothing_written_is_broken(self):
        for row in link_table.ROWS:
            self.assertEqual(broken(row, "points", 0, written=0), ["points lost"], row.name)


if __name__ == "__main__":
    unittest.main()
