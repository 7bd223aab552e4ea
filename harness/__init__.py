"""Benchmarks, tables and the command line."""

from __future__ import annotations
