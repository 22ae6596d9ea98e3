"""Environments, rewards and worlds that policies are trained in; needs the extra ``train``."""
