//! Contact laws of every kind except the paper's.

use sd_core::{ContactLaws, ContactScheme, FrictionOnset, NormalLaw, TangentialLaw};

/// Springs of a stiffness in units of the critical load.
pub(crate) fn spring(stiffness: f64, tangential: TangentialLaw) -> ContactScheme {
    ContactScheme::Laws(ContactLaws::linear_spring(stiffness, tangential, 0.01))
}

/// Rigid contacts.
pub(crate) fn rigid(tangential: TangentialLaw) -> ContactScheme {
    ContactScheme::Laws(ContactLaws {
        tangential,
        ..ContactLaws::PAPER
    })
}

/// Rigid contacts with tangential springs of a stiffness in units of the critical load.
pub(crate) fn rigid_springs(stiffness: f64) -> ContactScheme {
    ContactScheme::Laws(ContactLaws {
        tangential_stiffness: stiffness,
        ..*rigid(TangentialLaw::StickSlide).laws()
    })
}

/// Laws of every kind, alone and together.
pub(crate) fn schemes() -> Vec<ContactScheme> {
    let hertz = |tangential| {
        ContactScheme::Laws(ContactLaws {
            normal: NormalLaw::Hertz,
            dashpot: 1.0,
            onset: FrictionOnset::Reduced,
            ..ContactLaws::linear_spring(1e5, tangential, 0.01)
        })
    };
    let repelling = |normal, stiffness, tangential| {
        ContactScheme::Laws(ContactLaws {
            normal,
            stiffness,
            repulsion: 1.0,
            repulsion_length: 0.02,
            ..ContactLaws::linear_spring(1e4, tangential, 0.01)
        })
    };
    let at_every_contact = || {
        ContactScheme::Laws(ContactLaws {
            onset: FrictionOnset::Contact,
            repulsion: 1.0,
            repulsion_length: 0.02,
            ..ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01)
        })
    };
    let with = |contact: ContactScheme, rolling_friction, adhesion| {
        ContactScheme::Laws(ContactLaws {
            rolling_friction,
            adhesion,
            ..*contact.laws()
        })
    };
    let attracting = |laws| {
        ContactScheme::Laws(ContactLaws {
            van_der_waals: 0.2,
            van_der_waals_length: 0.02,
            ..laws
        })
    };
    let rough = |laws| {
        ContactScheme::Laws(ContactLaws {
            hydrodynamic_friction: 0.3,
            hydrodynamic_friction_range: 0.05,
            ..laws
        })
    };
    vec![
        rigid(TangentialLaw::Coulomb),
        rigid(TangentialLaw::StickRotate),
        with(rigid(TangentialLaw::Coulomb), 0.1, 0.0),
        with(rigid(TangentialLaw::Coulomb), 0.0, 2.0),
        with(rigid(TangentialLaw::RollSlip), 0.0, 2.0),
        with(rigid(TangentialLaw::Coulomb), 0.1, 1.0),
        rigid_springs(1e4),
        with(rigid_springs(1e4), 0.1, 1.0),
        rough(*rigid(TangentialLaw::Coulomb).laws()),
        rough(*spring(1e4, TangentialLaw::RollSlip).laws()),
        with(spring(1e4, TangentialLaw::StickSlide), 0.1, 0.0),
        with(spring(1e4, TangentialLaw::StickSlide), 0.1, 1.0),
        with(spring(1e4, TangentialLaw::Coulomb), 0.1, 0.0),
        with(hertz(TangentialLaw::StickSlide), 0.1, 1.0),
        spring(1e4, TangentialLaw::RollSlip),
        spring(1e4, TangentialLaw::StickSlide),
        spring(1e4, TangentialLaw::Coulomb),
        spring(1e4, TangentialLaw::StickRotate),
        hertz(TangentialLaw::RollSlip),
        hertz(TangentialLaw::StickSlide),
        repelling(
            NormalLaw::ExponentialRepulsion,
            f64::INFINITY,
            TangentialLaw::RollSlip,
        ),
        repelling(NormalLaw::LinearSpring, 1e4, TangentialLaw::StickSlide),
        at_every_contact(),
        repelling(NormalLaw::Rigid, f64::INFINITY, TangentialLaw::Coulomb),
        attracting(*rigid(TangentialLaw::Coulomb).laws()),
        attracting(*at_every_contact().laws()),
        ContactScheme::Laws(ContactLaws {
            repulsion: 1.0,
            repulsion_length: 0.02,
            lubrication_gap: 0.001,
            ..*rigid_springs(1e4).laws()
        }),
    ]
}
