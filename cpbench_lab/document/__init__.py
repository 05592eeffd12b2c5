"""The report as a LaTeX document: text, tables and pgfplots figures whose numbers are macros, and a bibliography."""
