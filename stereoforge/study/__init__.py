"""The domain-gap study: train on some domains, test on others, and say what closes the gap between them."""

from stereoforge.study.plan import DomainPlan, StudyPlan, read_plan
from stereoforge.study.results import StudyResult
from stereoforge.study.run import run_study

__all__ = ["DomainPlan", "StudyPlan", "StudyResult", "read_plan", "run_study"]
