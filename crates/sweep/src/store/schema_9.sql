-- What schema 9 adds to schema 8: normal stress differences, particle pressure, and all stresses by their causes, in mu·rate;
-- and the shear rate at every sample, which follows from the stress where that is imposed.

ALTER TABLE samples ADD COLUMN shear_hydrodynamic REAL;
ALTER TABLE samples ADD COLUMN shear_normal_contact REAL;
ALTER TABLE samples ADD COLUMN shear_tangential_contact REAL;
ALTER TABLE samples ADD COLUMN shear_repulsion REAL;
ALTER TABLE samples ADD COLUMN n1_hydrodynamic REAL;
ALTER TABLE samples ADD COLUMN n1_normal_contact REAL;
ALTER TABLE samples ADD COLUMN n1_tangential_contact REAL;
ALTER TABLE samples ADD COLUMN n1_repulsion REAL;
ALTER TABLE samples ADD COLUMN n2_hydrodynamic REAL;
ALTER TABLE samples ADD COLUMN n2_normal_contact REAL;
ALTER TABLE samples ADD COLUMN n2_tangential_contact REAL;
ALTER TABLE samples ADD COLUMN n2_repulsion REAL;
ALTER TABLE samples ADD COLUMN particle_pressure_normal_contact REAL;
ALTER TABLE samples ADD COLUMN particle_pressure_repulsion REAL;
ALTER TABLE samples ADD COLUMN shear_rate REAL;

ALTER TABLE results ADD COLUMN n1 REAL;
ALTER TABLE results ADD COLUMN n2 REAL;
ALTER TABLE results ADD COLUMN particle_pressure REAL;
ALTER TABLE results ADD COLUMN shear_hydrodynamic REAL;
ALTER TABLE results ADD COLUMN shear_normal_contact REAL;
ALTER TABLE results ADD COLUMN shear_tangential_contact REAL;
ALTER TABLE results ADD COLUMN shear_repulsion REAL;
ALTER TABLE results ADD COLUMN n1_hydrodynamic REAL;
ALTER TABLE results ADD COLUMN n1_normal_contact REAL;
ALTER TABLE results ADD COLUMN n1_tangential_contact REAL;
ALTER TABLE results ADD COLUMN n1_repulsion REAL;
ALTER TABLE results ADD COLUMN n2_hydrodynamic REAL;
ALTER TABLE results ADD COLUMN n2_normal_contact REAL;
ALTER TABLE results ADD COLUMN n2_tangential_contact REAL;
ALTER TABLE results ADD COLUMN n2_repulsion REAL;
ALTER TABLE results ADD COLUMN particle_pressure_normal_contact REAL;
ALTER TABLE results ADD COLUMN particle_pressure_repulsion REAL;
