-- What schema 4 adds to schema 3: contact laws chosen one by one. The defaults are those of the schemes before.

ALTER TABLE cases ADD COLUMN tangential TEXT NOT NULL DEFAULT 'roll-slip';
ALTER TABLE cases ADD COLUMN friction_onset TEXT NOT NULL DEFAULT 'critical-load';
ALTER TABLE cases ADD COLUMN stiffness REAL NOT NULL DEFAULT 9e999;             -- in F_crit/a; infinite: rigid
ALTER TABLE cases ADD COLUMN tangential_stiffness REAL NOT NULL DEFAULT 0.0;    -- over stiffness
ALTER TABLE cases ADD COLUMN dashpot REAL NOT NULL DEFAULT 0.0;                 -- in mu a
ALTER TABLE cases ADD COLUMN lubrication_gap REAL NOT NULL DEFAULT 0.0;
ALTER TABLE cases ADD COLUMN repulsion REAL NOT NULL DEFAULT 0.0;               -- in F_crit
ALTER TABLE cases ADD COLUMN repulsion_length REAL NOT NULL DEFAULT 0.0;

-- What a run is and what came out of it.
DROP VIEW IF EXISTS runs;
CREATE VIEW runs AS
SELECT c.key, c.state, c.area_fraction, c.friction, c.roughness, c.shear_rate, c.spheres, c.size_ratio,
       c.large_fraction, c.hydrodynamics, c.contact, c.tangential, c.friction_onset, c.stiffness,
       c.tangential_stiffness, c.dashpot, c.lubrication_gap, c.repulsion, c.repulsion_length, c.seed, r.*
FROM cases c LEFT JOIN results r ON r.case_id = c.id
WHERE c.position IS NOT NULL
ORDER BY c.position;

DROP VIEW IF EXISTS viscosity_vs_shear_rate;
-- One row for every point: all finished runs that differ only in their seed. The 95 % interval is
-- viscosity ± t × standard_error, t of Student's distribution with runs - 1 degrees of freedom.
CREATE VIEW viscosity_vs_shear_rate AS
WITH points AS (
    SELECT min(c.position) AS position, c.hydrodynamics, c.contact, c.spheres, c.area_fraction, c.size_ratio,
           c.large_fraction, c.roughness, c.friction, c.tangential, c.friction_onset, c.stiffness, c.tangential_stiffness,
           c.dashpot, c.lubrication_gap, c.repulsion, c.repulsion_length, c.time_step, c.shear_rate, count(r.viscosity) AS runs,
           avg(r.viscosity) AS viscosity,
           CASE WHEN count(r.viscosity) > 1 THEN
               max(avg(r.viscosity * r.viscosity) - avg(r.viscosity) * avg(r.viscosity), 0.0) / (count(r.viscosity) - 1)
           END AS variance,
           min(r.viscosity) AS viscosity_minimum, max(r.viscosity) AS viscosity_maximum,
           avg(r.viscosity_stresslet) AS viscosity_stresslet, avg(r.normal_stress_difference) AS normal_stress_difference,
           total(r.contacts) / nullif(total(r.samples) * c.spheres, 0) AS contacts_per_sphere,
           total(r.activated) / nullif(total(r.contacts), 0) AS activated_fraction,
           total(r.rolling) / nullif(total(r.activated), 0) AS rolling_fraction
    FROM cases c JOIN results r ON r.case_id = c.id
    WHERE c.position IS NOT NULL AND c.state = 'done'
    GROUP BY c.hydrodynamics, c.contact, c.spheres, c.area_fraction, c.size_ratio, c.large_fraction, c.roughness,
             c.friction, c.tangential, c.friction_onset, c.stiffness, c.tangential_stiffness, c.dashpot, c.lubrication_gap,
             c.repulsion, c.repulsion_length, c.time_step, c.shear_rate
)
SELECT hydrodynamics, contact, spheres, area_fraction, size_ratio, large_fraction, roughness, friction, tangential, friction_onset,
       stiffness, tangential_stiffness, dashpot, lubrication_gap, repulsion, repulsion_length, time_step, shear_rate, runs, viscosity,
       -- Square root by Newton's method: not every SQLite has one built in.
       CASE WHEN variance > 0.0 THEN
           (WITH RECURSIVE newton (n, x) AS (
                SELECT 0, 0.5 * (1.0 + variance) UNION ALL SELECT n + 1, 0.5 * (x + variance / x) FROM newton WHERE n < 60)
            SELECT x FROM newton WHERE n = 60)
       ELSE variance END AS standard_error,
       viscosity_minimum, viscosity_maximum, viscosity_stresslet, normal_stress_difference, contacts_per_sphere,
       activated_fraction, rolling_fraction
FROM points
ORDER BY position;
