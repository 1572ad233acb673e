//! The examples run.

#[path = "../examples/layer.rs"]
mod layer;
#[path = "../examples/pair.rs"]
mod pair;

#[test]
fn layer_is_sheared() {
    layer::main().expect("the example of a layer");
}

#[test]
fn spheres_pass() {
    pair::main().expect("the example of a pair");
}
