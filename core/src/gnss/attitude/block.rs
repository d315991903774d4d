//! Kinds of satellites, as far as their attitude differs.

/// A kind of satellite, by how it turns about the axis to the Earth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Block {
    /// GPS II and IIA.
    GpsIIA,
    /// GPS IIR-A, IIR-B and IIR-M.
    GpsIIR,
    /// GPS IIF.
    GpsIIF,
    /// GPS III.
    GpsIII,
    /// GLONASS-M (and the first generation).
    GlonassM,
    /// GLONASS-K.
    GlonassK,
    /// Galileo In-Orbit Validation.
    GalileoIov,
    /// Galileo Full Operational Capability.
    GalileoFoc,
    /// BeiDou-2, inclined geosynchronous or medium orbit.
    BeiDou2,
    /// BeiDou-3 of CAST, medium orbit.
    BeiDou3CastMeo,
    /// BeiDou-3 of CAST, inclined geosynchronous orbit.
    BeiDou3CastIgso,
    /// BeiDou-3 of SECM.
    BeiDou3Secm,
    /// QZSS of the first block.
    QzssI,
    /// QZSS of the second block, inclined geosynchronous orbit.
    QzssII,
    /// BeiDou or QZSS, geostationary.
    Geostationary,
    /// Any other.
    Unknown,
}

impl Block {
    /// From the antenna type of a satellite in ANTEX files (`BLOCK IIF`, `GALILEO-2`), as in IGS's rcvr_ant.tab.
    pub fn from_antex(antenna_type: &str) -> Self {
        let name = antenna_type.trim();
        // Longer names before their beginnings.
        const NAMES: [(&str, Block); 20] = [
            ("BLOCK IIIA", Block::GpsIII),
            ("BLOCK IIIF", Block::Unknown),
            ("BLOCK IIA", Block::GpsIIA),
            ("BLOCK IIR", Block::GpsIIR),
            ("BLOCK IIF", Block::GpsIIF),
            ("GLONASS-M", Block::GlonassM),
            ("GLONASS-K", Block::GlonassK),
            ("GALILEO-1", Block::GalileoIov),
            ("GALILEO-2", Block::GalileoFoc),
            ("BEIDOU-2G", Block::Geostationary),
            ("BEIDOU-3G", Block::Geostationary),
            ("BEIDOU-2I", Block::BeiDou2),
            ("BEIDOU-2M", Block::BeiDou2),
            ("BEIDOU-3I", Block::BeiDou3CastIgso),
            ("BEIDOU-3M-CAST", Block::BeiDou3CastMeo),
            ("BEIDOU-3M-SECM", Block::BeiDou3Secm),
            ("QZSS-2G", Block::Geostationary),
            ("QZSS-2I", Block::QzssII),
            ("QZSS-2A", Block::QzssII),
            ("QZSS-3G", Block::Geostationary),
        ];
        match name {
            "BLOCK II" => Self::GpsIIA,
            "GLONASS" => Self::GlonassM,
            "QZSS" => Self::QzssI,
            _ => NAMES.iter().find(|(start, _)| name.starts_with(start)).map_or(Self::Unknown, |entry| entry.1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_antex_files_are_known() {
        // All satellite antenna types of igs14.atx (week 2134) but BLOCK I, GALILEO-0A/B, BEIDOU-3S… and IRNSS.
        for (name, block) in [
            ("BLOCK II            ", Block::GpsIIA),
            ("BLOCK IIA", Block::GpsIIA),
            ("BLOCK IIR-A", Block::GpsIIR),
            ("BLOCK IIR-M", Block::GpsIIR),
            ("BLOCK IIF", Block::GpsIIF),
            ("BLOCK IIIA", Block::GpsIII),
            ("GLONASS", Block::GlonassM),
            ("GLONASS-M", Block::GlonassM),
            ("GLONASS-K1", Block::GlonassK),
            ("GALILEO-1", Block::GalileoIov),
            ("GALILEO-2", Block::GalileoFoc),
            ("BEIDOU-2G", Block::Geostationary),
            ("BEIDOU-3G-CAST", Block::Geostationary),
            ("BEIDOU-2M", Block::BeiDou2),
            ("BEIDOU-3I", Block::BeiDou3CastIgso),
            ("BEIDOU-3M-CAST", Block::BeiDou3CastMeo),
            ("BEIDOU-3M-SECM", Block::BeiDou3Secm),
            ("QZSS", Block::QzssI),
            ("QZSS-2G", Block::Geostationary),
            ("QZSS-2I", Block::QzssII),
            ("BLOCK I", Block::Unknown),
            ("BEIDOU-3SM-CAST", Block::Unknown),
            ("", Block::Unknown),
        ] {
            assert_eq!(Block::from_antex(name), block, "{name}");
        }
    }
}
