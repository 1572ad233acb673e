//! Tests across modules.

mod inconsistent_friction;
mod iterated_far_field;
