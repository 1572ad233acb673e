//! Tests across modules.

mod iterated_far_field;
