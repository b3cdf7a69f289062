"""Columns with names and units become records or frequency responses, whatever format they came from."""

from modalscope.io.columns.build import contents_from_table
from modalscope.io.columns.table import Column, Table

__all__ = ["Column", "Table", "contents_from_table"]
