//! Junctions within a net: a dot distinguishes a junction from a crossing of two nets.

type Point = (f64, f64);

/// A straight line between two points.
pub(super) type Line = [Point; 2];

/// Tolerance within which two points are equal: far less than the width of a line.
const SAME: f64 = 0.05;

/// The points where lines of one net meet from three or four directions; all lines are horizontal or vertical.
pub(super) fn junctions(lines: &[Line]) -> Vec<Point> {
    let mut found: Vec<Point> = vec![];
    for &point in lines.iter().flatten() {
        let is_known = found.iter().any(|other| is_same(point, *other));
        if !is_known && directions(lines, point) >= 3 {
            found.push(point);
        }
    }
    found
}

fn is_same(one: Point, other: Point) -> bool {
    (one.0 - other.0).abs() < SAME && (one.1 - other.1).abs() < SAME
}

/// The number of directions in which lines leave a point.
fn directions(lines: &[Line], (x, y): Point) -> usize {
    // Right, left, down, up.
    let mut there = [false; 4];
    for [(x1, y1), (x2, y2)] in lines {
        let across = [x1 - x, x2 - x];
        let along = [y1 - y, y2 - y];
        for (first, way, side) in [(0, across, along), (2, along, across)] {
            let (low, high) = (way[0].min(way[1]), way[0].max(way[1]));
            if side.iter().all(|far| far.abs() < SAME) && low < SAME && high > -SAME {
                there[first] |= high > SAME;
                there[first + 1] |= low < -SAME;
            }
        }
    }
    there.iter().filter(|goes_on| **goes_on).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_lines_make_a_junction_and_a_corner_or_a_line_on_a_line_does_not() {
        let level = [(0.0, 0.0), (10.0, 0.0)];
        assert_eq!(junctions(&[level, [(4.0, 0.0), (4.0, 5.0)]]), [(4.0, 0.0)]);
        assert!(junctions(&[level, [(10.0, 0.0), (10.0, 5.0)]]).is_empty());
        assert!(
            junctions(&[level, [(10.0, 0.0), (20.0, 0.0)], [(2.0, 0.0), (6.0, 0.0)]]).is_empty()
        );
        // Crossing lines of one net are joined where one of them ends or bends.
        let bent = [[(4.0, -5.0), (4.0, 0.0)], [(4.0, 0.0), (4.0, 5.0)]];
        assert_eq!(junctions(&[level, bent[0], bent[1]]), [(4.0, 0.0)]);
    }
}
