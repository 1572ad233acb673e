//! Writes the constants of the equal-sphere near-field table to standard output.
//!
//! ```text
//! cargo run --release -p sd-core --example equal_spheres_table > crates/sd-core/src/two_sphere/equal_spheres.rs
//! ```

#![expect(
    clippy::print_stdout,
    reason = "writing to standard output is what it is for"
)]

use sd_core::two_sphere::NearField;
use serde::Deserialize;

/// The parts needed of a stored table.
#[derive(Deserialize)]
struct Stored {
    /// ξ at which the near-contact variable is 1.
    scale: f64,
    /// Near-contact coefficients, both labellings.
    fitted: Vec<Vec<f64>>,
    /// Values at the nodes, both labellings.
    nodes: Vec<Vec<f64>>,
}

/// One array of rows, the first half: with equal spheres the labellings agree.
fn print_rows(name: &str, text: &str, rows: &[Vec<f64>]) {
    let rows = &rows[..rows.len() / 2];
    println!("\n/// {text}\n#[rustfmt::skip]");
    println!("pub(super) static {name}: [[f64; 20]; {}] = [", rows.len());
    for row in rows {
        let numbers: Vec<String> = row.iter().map(|x| format!("{x:?}")).collect();
        println!("    [{}],", numbers.join(", "));
    }
    println!("];");
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let table = NearField::new(1.0)?;
    let stored: Stored = serde_json::from_str(&serde_json::to_string(&table)?)?;
    println!("//! What is solved for to make the near-field table of equal spheres.");
    println!("//!");
    println!(
        "//! Written by the example `equal_spheres_table`; compared with a fresh solution by the test"
    );
    println!("//! `equal_sphere_constants_are_what_solving_gives`.");
    println!("\n/// ξ at which the near-contact variable is 1.");
    println!("pub(super) const SCALE: f64 = {:?};", stored.scale);
    print_rows(
        "FITTED",
        "Near-contact coefficients: a row per term, the functions in the order of `Scalars`.",
        &stored.fitted,
    );
    print_rows(
        "NODES",
        "The functions at the nodes, in the order of `Scalars`.",
        &stored.nodes,
    );
    Ok(())
}
