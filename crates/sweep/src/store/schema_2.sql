-- What schema 2 adds to schema 1: frames of runs, and a view of the curves.

-- Layers at the sampled strains, where a run was asked to keep them.
CREATE TABLE frames (
    case_id INTEGER NOT NULL REFERENCES cases (id),
    step    INTEGER NOT NULL,
    strain  REAL NOT NULL,
    data    BLOB NOT NULL,              -- version, then content
    PRIMARY KEY (case_id, step)
) WITHOUT ROWID;

-- One row for every point: all finished runs that differ only in their seed. The 95 % interval is
-- viscosity ± t × standard_error, t of Student's distribution with runs - 1 degrees of freedom.
CREATE VIEW viscosity_vs_shear_rate AS
WITH points AS (
    SELECT min(c.position) AS position, c.hydrodynamics, c.contact, c.spheres, c.area_fraction, c.size_ratio,
           c.large_fraction, c.roughness, c.friction, c.time_step, c.shear_rate, count(r.viscosity) AS runs,
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
             c.friction, c.time_step, c.shear_rate
)
SELECT hydrodynamics, contact, spheres, area_fraction, size_ratio, large_fraction, roughness, friction, time_step,
       shear_rate, runs, viscosity,
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
