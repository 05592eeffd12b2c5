from typing import Any

import overhead_qps
from benchopt import BaseDataset
from qpsolvers import Problem


class Dataset(BaseDataset):
    name = "random"
    parameters = {"problem_seed": list(range(overhead_qps.count()))}

    def get_data(self) -> dict[str, Any]:
        return {"problem": Problem(**overhead_qps.random_qp(self.problem_seed))}
