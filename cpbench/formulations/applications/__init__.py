"""Problems that people have under another name, as formulations, and their own unknowns from the answers: bimatrix
games, least squares, boxed LCPs of physics engines."""
