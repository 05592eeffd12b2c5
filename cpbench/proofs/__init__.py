"""Proofs that a problem has no solution, or no least objective, in rational arithmetic; knows no solver."""

from cpbench.proofs.certificates import SECONDS as SECONDS
from cpbench.proofs.certificates import Infeasible as Infeasible
from cpbench.proofs.certificates import Proof as Proof
from cpbench.proofs.certificates import ProofAttempt as ProofAttempt
from cpbench.proofs.certificates import Unbounded as Unbounded
from cpbench.proofs.certificates import certified_infeasible as certified_infeasible
from cpbench.proofs.certificates import holds as holds
from cpbench.proofs.certificates import packed as packed
from cpbench.proofs.certificates import prove as prove
from cpbench.proofs.certificates import unpacked as unpacked
from cpbench.proofs.polyhedra import conditions as conditions
from cpbench.proofs.polyhedra import objective as objective
