//! Integer ambiguities: decorrelation, bootstrapping, integer least squares, success rates and acceptance tests.
