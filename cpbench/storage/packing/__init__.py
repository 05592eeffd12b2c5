"""Problems made from loose matrices and vectors in files: `parts` of one problem, `steps` of a sequence, `remarks`."""
