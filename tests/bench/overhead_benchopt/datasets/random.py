from typing import Any

import overhead_qps
from benchopt import BaseDataset
from qpsolvers import Problem


class Dataset(BaseDataset):
    name = "random"
    parameters = {"path": overhead_qps.paths()}

    def get_data(self) -> dict[str, Any]:
        return {"problem": Problem(**overhead_qps.read(self.path))}
