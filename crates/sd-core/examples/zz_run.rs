//! throwaway: run and report
use sd_core::*;
fn main() {
    let law = std::env::args().nth(1).unwrap();
    let a: Vec<f64> = std::env::args()
        .skip(2)
        .map(|s| s.parse().unwrap())
        .collect();
    let (n, c, nu, gamma, strain, dt, seed) =
        (a[0] as usize, a[1], a[2], a[3], a[4], a[5], a[6] as u64);
    let ratio = a.get(7).copied().unwrap_or(1.0);
    let h = a.get(8).copied().unwrap_or(0.01);
    let stiff = a.get(9).copied().unwrap_or(1e4);
    let spring = |tangential| ContactLaws::linear_spring(stiff, tangential, h);
    use TangentialLaw::*;
    let (full, law) = match law.strip_prefix("full-") {
        Some(l) => (true, l.to_string()),
        None => (false, law),
    };
    let contact = match law.as_str() {
        "rigid" => ContactScheme::Rigid,
        "procedure" => ContactScheme::Procedure,
        "coulomb" => ContactScheme::Laws(ContactLaws {
            tangential: Coulomb,
            ..ContactLaws::PAPER
        }),
        "stick-slide" => ContactScheme::Laws(spring(StickSlide)),
        "spring-coulomb" => ContactScheme::Laws(spring(Coulomb)),
        "spring-roll" => ContactScheme::Laws(spring(RollSlip)),
        "stick-rotate" => ContactScheme::Laws(ContactLaws {
            tangential: StickRotate,
            ..ContactLaws::PAPER
        }),
        "hertz" => ContactScheme::Laws(ContactLaws {
            normal: NormalLaw::Hertz,
            stiffness: 10.0 * stiff,
            ..spring(StickSlide)
        }),
        "rep" => ContactScheme::Laws(ContactLaws {
            normal: NormalLaw::ExponentialRepulsion,
            repulsion: 1.0,
            repulsion_length: 0.02,
            lubrication_gap: 0.001,
            ..ContactLaws::PAPER
        }),
        "srot" => ContactScheme::Laws(spring(StickRotate)),
        "hrep" => ContactScheme::Laws(ContactLaws {
            repulsion: 1.0,
            repulsion_length: 0.02,
            ..spring(StickSlide)
        }),
        _ => panic!(),
    };
    let p = Params {
        spheres: n,
        area_fraction: c,
        roughness: h,
        friction: nu,
        shear_rate: gamma,
        size_ratio: ratio,
        large_fraction: 0.5,
        hydrodynamics: if full {
            Hydrodynamics::StokesianDynamics
        } else {
            Hydrodynamics::BallMelrose
        },
        contact,
        time_step: dt,
    };
    let mut s = Simulation::new(&p, seed, &NearFields::default()).unwrap();
    let mut sum = vec![];
    let cpu = || {
        let t = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
    };
    let t1 = cpu();
    let mut slow = vec![];
    let mut end = String::from("done");
    while s.strain() < strain - 1e-9 {
        let t = cpu();
        match s.step() {
            Ok(x) => sum.push(x.viscosity),
            Err(e) => {
                end = format!("FAILED {e}");
                break;
            }
        }
        slow.push(cpu() - t);
        if s.flow() == Flow::Jammed {
            end = format!("jammed at {}", s.strain());
            break;
        }
    }
    let total = cpu() - t1;
    let skip = sum.len() / 3;
    let m = sum[skip..].iter().sum::<f64>() / (sum.len() - skip).max(1) as f64;
    let mut q = sum[skip..].to_vec();
    q.sort_by(f64::total_cmp);
    slow.sort_by(f64::total_cmp);
    let c = s.counters();
    println!(
        "{law}{} N {n} nu {nu}: {end} | cpu {total:.3} s, stages {}, ms/stage {:.3} | mean {m:.5} median {:.5} second {:?} tenth {:?} | unconverged {} res {:.1e} fr {:.1e} gap {:.5} | slowest/median {:.1}",
        if full { " full" } else { "" },
        c.stages,
        1e3 * total / c.stages.max(1) as f64,
        q.get(q.len() / 2).unwrap_or(&0.0),
        sum.get(1),
        sum.get(9),
        c.unconverged_stages,
        c.worst_residual,
        c.worst_friction_error,
        c.minimum_gap,
        slow.last().unwrap_or(&0.0) / slow.get(slow.len() / 2).unwrap_or(&1.0)
    );
}
