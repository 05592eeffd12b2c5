"""Problems from formulas: one family a file, with what is known of their solutions.

Data are made of small dyadic fractions wherever a solution is planted, so that products and sums are exact in
double precision and the files come out bit for bit alike on every machine.
"""

from pathlib import Path

from cpbench.generators import descriptions

descriptions.include(Path(__file__).parent / "descriptions")
