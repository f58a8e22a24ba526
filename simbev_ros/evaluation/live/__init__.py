"""Evaluates a running scene: joins truth and answers by stamp and keeps running figures."""
