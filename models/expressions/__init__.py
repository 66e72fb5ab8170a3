"""Formulas: parsed to an expression tree, evaluated and differentiated over batches."""

from .domain import domain_margin
from .formula import Formula
from .functions import CONSTANTS, FUNCTIONS
from .parser import FormulaError

__all__ = ["CONSTANTS", "FUNCTIONS", "Formula", "FormulaError", "domain_margin"]
