"""Plans within a tolerance, and the cost model behind them."""
