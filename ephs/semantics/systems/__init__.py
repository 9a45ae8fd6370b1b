"""Filled patterns: values, their laws, balances and reports."""
