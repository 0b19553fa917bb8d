"""Channel parameters: spreads in delay and angle, K-factor, path loss, clusters, each with its definition and error."""
