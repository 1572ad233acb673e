//! Tests of rooms together, above all of which they stand.

mod iterated_far_field;
